//! `randt log info`: what is in a log.

use crate::exit::Outcome;
use crate::output::print_value;
use crate::units::bytes;
use randt_log::LogReader;
use randt_messages::{DropCause, LogDrop, LogDropTopic, health::text_of};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `randt log info`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The log
    file: PathBuf,
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// One topic.
#[derive(Debug, Serialize)]
struct Topic {
    r#type: String,
    encoding: String,
    messages: u64,
    bytes: u64,
    first_ns: i64,
    last_ns: i64,
}

/// What was not recorded, for one topic and cause.
#[derive(Debug, Serialize)]
struct Missing {
    topic: String,
    cause: &'static str,
    messages: u64,
    begin_ns: i64,
    end_ns: i64,
}

/// Everything that is printed.
#[derive(Debug, Default, Serialize)]
struct Info {
    written_by: String,
    size_bytes: u64,
    begin_ns: Option<i64>,
    end_ns: Option<i64>,
    topics: BTreeMap<String, Topic>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    missing: Vec<Missing>,
    damage: Vec<String>,
}

/// Reads the log through and prints.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut reader = LogReader::open(&arguments.file)?;
    let mut info = Info::default();
    while let Some(entry) = reader.next_entry()? {
        let time_ns = entry.time_ns;
        let of_channel = || Topic {
            r#type: entry.channel.type_name.clone(),
            encoding: entry.channel.message_encoding.clone(),
            messages: 0,
            bytes: 0,
            first_ns: time_ns,
            last_ns: time_ns,
        };
        if let Ok(Some(drop)) = entry.decode::<LogDropTopic>() {
            info.missing.push(missing(&drop.head));
        }
        let name = entry.channel.topic.clone();
        let topic = info.topics.entry(name).or_insert_with(of_channel);
        topic.messages += 1;
        topic.bytes += entry.bytes.len() as u64;
        topic.first_ns = topic.first_ns.min(time_ns);
        topic.last_ns = topic.last_ns.max(time_ns);
    }
    info.begin_ns = info.topics.values().map(|topic| topic.first_ns).min();
    info.end_ns = info.topics.values().map(|topic| topic.last_ns).max();
    reader.written_by().clone_into(&mut info.written_by);
    info.size_bytes = reader.progress().1;
    info.metadata = reader.all_metadata().clone();
    let damage = reader.damage().iter();
    info.damage = damage
        .map(|damage| format!("{} {}: {}", damage.count, damage.kind.name(), damage.first))
        .collect();
    let name = arguments.file.display().to_string();
    print_value(arguments.json, &info, || text(&info, &name))?;
    Ok(Outcome::finished(!info.missing.is_empty()))
}

fn missing(drop: &LogDrop) -> Missing {
    Missing {
        topic: text_of(&drop.topic).to_owned(),
        cause: DropCause::from_code(drop.cause).name(),
        messages: drop.count,
        begin_ns: drop.begin_ns,
        end_ns: drop.end_ns,
    }
}

/// For people. Writing to a String cannot fail.
fn text(info: &Info, name: &str) -> String {
    let begin_ns = info.begin_ns.unwrap_or_default();
    let after_s = |time_ns: i64| (time_ns - begin_ns) as f64 * 1e-9;
    let span_s = after_s(info.end_ns.unwrap_or(begin_ns));
    let mut text = format!(
        "{name}: {span_s:.1} s from {:.3}, {}, by {}\n",
        begin_ns as f64 * 1e-9,
        bytes(info.size_bytes),
        info.written_by
    );
    for (name, topic) in &info.topics {
        let span_s = after_s(topic.last_ns) - after_s(topic.first_ns);
        let rate_hz = match topic.messages {
            messages @ 2.. if span_s > 0.0 => (messages - 1) as f64 / span_s,
            _ => 0.0,
        };
        let _ = writeln!(
            text,
            "  {name:<22} {:>8} {rate_hz:>7.1} Hz {:>9}  {}",
            topic.messages,
            bytes(topic.bytes),
            topic.r#type
        );
    }
    for (name, values) in &info.metadata {
        let _ = writeln!(text, "  {name}");
        for (key, value) in values.iter().filter(|(_, value)| !value.contains('\n')) {
            let _ = writeln!(text, "    {key}: {value}");
        }
        for (key, value) in values.iter().filter(|(_, value)| value.contains('\n')) {
            let _ = writeln!(text, "    {key}: {} lines", value.lines().count());
        }
    }
    for missing in &info.missing {
        let _ = writeln!(
            text,
            "  missing {} of {}: {}, from {:.3} s to {:.3} s",
            missing.messages,
            missing.topic,
            missing.cause,
            after_s(missing.begin_ns),
            after_s(missing.end_ns)
        );
    }
    for damage in &info.damage {
        let _ = writeln!(text, "  damaged {damage}");
    }
    text
}
