//! An MCAP in Foxglove's well-known schemas alone, for viewers that know nothing of ours: also
//! what the recorder leaves out because it follows from the rest.

mod translator;

use crate::output::{finish, log_options};
use crate::units::{bytes, count};
use crate::{job, progress, recorded};
use anyhow::ensure;
use randt_log::{ChannelId, Compression, LogFile, LogReader, Options};
use std::io::{Read, Seek};
use std::path::Path;
use translator::{Shown, TOPICS, Translator};

/// Writes one file. What the log lacks for a view is a warning, and the others are written.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, out: &Path) -> anyhow::Result<String> {
    let config = recorded::configuration(reader.robot()?, reader.configuration())?;
    job::catch_interrupts();
    let options = Options {
        compression: Some(Compression::Zstd),
        // No profile: the file follows the schemas' conventions and no others.
        profile: "",
        ..log_options()
    };
    let mut file = LogFile::create_copy(out, options)?;
    for (name, values) in reader.all_metadata().clone() {
        file.write_metadata(&name, values)?;
    }
    // A view's channel begins with its first message, so that viewers list no empty ones.
    let mut views = TOPICS.map(|topic| (topic, None::<ChannelId>, 0_u64));
    let mut write = |shown: &mut Vec<Shown>| -> anyhow::Result<()> {
        for Shown { view, label, bytes } in shown.drain(..) {
            let found = views.iter_mut().find(|(topic, ..)| topic.view == view);
            let Some((topic, id, written)) = found else {
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
        ensure!(!job::interrupted(), "interrupted; nothing was written");
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
    let messages: u64 = views.iter().map(|(.., written)| written).sum();
    ensure!(
        messages > 0,
        "the log holds nothing that a viewer could show; nothing was written"
    );
    for (topic, ..) in views.iter().filter(|(.., written)| *written == 0) {
        // A graph may lack a page, or not change while the log lasts.
        let is_there = reader.channels().any(|channel| channel.topic == topic.from);
        let whole = if is_there { "whole " } else { "" };
        if let Some(what) = topic.what {
            let from = topic.from;
            eprintln!("warning: the log has no {whole}{from}: {what} not shown");
        }
    }
    let size = finish(file, out)?;
    let views = views.iter().filter(|(.., written)| *written > 0).count() as u64;
    Ok(format!(
        "{} in {}, {}",
        count(messages, "message", "messages"),
        count(views, "view", "views"),
        bytes(size)
    ))
}
