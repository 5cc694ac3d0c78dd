//! An MCAP in Foxglove's well-known schemas alone, for viewers that know nothing of ours: also
//! what the recorder leaves out because it follows from the rest.

mod cells;
mod pace;
mod translator;

use crate::units::{bytes, count};
use crate::{job, progress, recorded};
use anyhow::{Context, bail};
use randt_log::{ChannelId, Compression, LogFile, LogReader, Options};
use std::io::{Read, Seek};
use std::path::Path;
use translator::{Shown, TOPICS, Translator};

/// Writes one file. What the log lacks for a view is a warning, and the others are written.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, out: &Path) -> anyhow::Result<String> {
    let config = recorded::configuration(reader.robot()?, reader.configuration())?;
    job::catch_interrupts();
    let options = Options {
        compression: Compression::Zstd,
        // No profile: the file follows the schemas' conventions and no others.
        profile: "",
        written_by: format!("randt {}", randt_version::VERSION),
        ..Options::default()
    };
    let mut file = LogFile::create_copy(out, options)?;
    for (name, values) in reader.all_metadata().clone() {
        file.write_metadata(&name, values)?;
    }
    // A view's channel begins with its first message, so that viewers list no empty ones.
    let mut channels = TOPICS.map(|_| None::<ChannelId>);
    let mut written = TOPICS.map(|_| 0_u64);
    let mut write = |shown: &mut Vec<Shown>| -> anyhow::Result<()> {
        for Shown { view, label, bytes } in shown.drain(..) {
            let index = TOPICS.iter().position(|topic| topic.view == view);
            let Some(index) = index else { continue };
            let (Some(topic), Some(id), Some(written)) = (
                TOPICS.get(index),
                channels.get_mut(index),
                written.get_mut(index),
            ) else {
                continue;
            };
            let id = match *id {
                Some(id) => id,
                None => *id.insert(file.writer().declare(&(topic.channel)(view))?),
            };
            file.writer().write_bytes(id, label, &bytes)?;
            *written += 1;
        }
        Ok(())
    };

    let bar = progress::bar(Some(reader.progress().1), "bytes");
    let mut translator = Translator::new(&config);
    let mut shown = Vec::new();
    let mut last = None;
    while let Some(entry) = reader.next_entry()? {
        if job::interrupted() {
            bail!("interrupted; nothing was written");
        }
        last = Some(entry.record_header());
        translator.see(&entry, &mut shown)?;
        write(&mut shown)?;
        bar.set_position(reader.progress().0);
    }
    if let Some(label) = last {
        translator.finish(label, &mut shown);
        write(&mut shown)?;
    }
    bar.finish_and_clear();
    let messages: u64 = written.iter().sum();
    if messages == 0 {
        bail!("the log holds nothing that a viewer could show; nothing was written");
    }
    for (topic, _) in TOPICS.iter().zip(written).filter(|(_, count)| *count == 0) {
        // A graph may lack a page, or not change while the log lasts.
        let is_there = reader.channels().any(|channel| channel.topic == topic.from);
        let whole = if is_there { "whole " } else { "" };
        if let Some(what) = topic.what {
            eprintln!(
                "warning: the log has no {whole}{}: {what} not shown",
                topic.from
            );
        }
    }
    let size = file
        .finish()
        .with_context(|| format!("{}: cannot be finished", out.display()))?;
    let views = written.iter().filter(|count| **count > 0).count() as u64;
    Ok(format!(
        "{} in {}, {}",
        count(messages, "message", "messages"),
        count(views, "view", "views"),
        bytes(size)
    ))
}
