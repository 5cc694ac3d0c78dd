//! A ROS 2 bag: a folder with an MCAP file of CDR messages, and the metadata that rosbag2 needs.

use super::ros::{Style, TOPICS, Translator, Type};
use crate::output::write_whole;
use crate::units::count;
use anyhow::Context;
use randt_log::{Channel, Compression, LogFile, LogReader, Options, RecordHeader};
use std::fmt::Write;
use std::io::{Read, Seek};
use std::path::Path;

/// Writes `NAME_0.mcap` and `metadata.yaml` into a folder called NAME.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, folder: &Path) -> anyhow::Result<String> {
    let name = folder.file_name().context("a folder with a name")?;
    let file_name = format!("{}_0.mcap", name.to_string_lossy());
    let path = folder.join(&file_name);
    let options = Options {
        compression: Compression::Zstd,
        profile: "ros2",
        ..Options::default()
    };
    let mut file = LogFile::create_copy(&path, options)?;
    let mut channels = Vec::new();
    for (topic, kind) in TOPICS {
        channels.push((topic, file.writer().declare(&channel(topic, kind))?));
    }
    let mut translator = Translator::new(Style::Cdr);
    let mut written = Written::default();
    let robot = reader.robot()?;
    while let Some(entry) = reader.next_entry()? {
        let mut messages = translator.translate(&entry)?;
        if let (None, Some(first)) = (written.begin_ns, messages.first()) {
            messages.insert(0, translator.mounting(&robot, first.stamp_ns));
        }
        for message in messages {
            let index = channels
                .iter()
                .position(|(topic, _)| *topic == message.topic);
            let Some((index, (_, id))) = index.and_then(|i| Some((i, channels.get(i)?))) else {
                continue;
            };
            let label = RecordHeader {
                sequence: 0,
                time_ns: message.stamp_ns,
            };
            file.writer().write_bytes(*id, label, &message.bytes)?;
            written.count(index, message.stamp_ns);
        }
    }
    file.finish()
        .with_context(|| format!("{}: cannot be finished", path.display()))?;
    let yaml = written.yaml(&file_name);
    write_whole(&folder.join("metadata.yaml"), yaml.as_bytes())?;
    let messages = written.messages.iter().sum();
    Ok(count(messages, "message", "messages"))
}

fn channel(topic: &str, kind: Type) -> Channel {
    Channel {
        topic: topic.to_owned(),
        type_name: type_name(kind),
        message_encoding: "cdr".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: kind.definition(Style::Cdr).into_bytes(),
        messages: 0,
    }
}

fn type_name(kind: Type) -> String {
    format!("{}/msg/{}", kind.package, kind.name)
}

#[derive(Default)]
struct Written {
    messages: [u64; TOPICS.len()],
    begin_ns: Option<i64>,
    end_ns: i64,
}

impl Written {
    fn count(&mut self, topic: usize, stamp_ns: i64) {
        if let Some(messages) = self.messages.get_mut(topic) {
            *messages += 1;
        }
        let begin_ns = self.begin_ns.get_or_insert(stamp_ns);
        *begin_ns = (*begin_ns).min(stamp_ns);
        self.end_ns = self.end_ns.max(stamp_ns);
    }

    /// Writing to a String cannot fail.
    fn yaml(&self, file: &str) -> String {
        let begin_ns = self.begin_ns.unwrap_or_default();
        let span_ns = self.end_ns - begin_ns;
        let messages: u64 = self.messages.iter().sum();
        let mut text = format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
             duration:\n    nanoseconds: {span_ns}\n  starting_time:\n    \
             nanoseconds_since_epoch: {begin_ns}\n  message_count: {messages}\n  \
             topics_with_message_count:\n"
        );
        for ((topic, kind), messages) in TOPICS.iter().zip(self.messages) {
            let kind = type_name(*kind);
            let _ = writeln!(
                text,
                "    - topic_metadata:\n        name: {topic}\n        type: {kind}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"\"\n      \
                 message_count: {messages}"
            );
        }
        let _ = writeln!(
            text,
            "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    \
             - {file}\n  files:\n    - path: {file}\n      starting_time:\n        \
             nanoseconds_since_epoch: {begin_ns}\n      duration:\n        \
             nanoseconds: {span_ns}\n      message_count: {messages}"
        );
        text
    }
}
