//! A ROS 2 bag: a folder with an MCAP file of CDR messages, and the metadata that rosbag2 needs.

use crate::output::{finish, write_whole};
use crate::ros_topics::{Message, TOPICS, Topic, Translator};
use crate::units::count;
use anyhow::Context;
use randt_log::{Channel, ChannelId, Compression, LogFile, LogReader, Options, RecordHeader};
use randt_ros_messages::Style;
use std::fmt::Write;
use std::io::{Read, Seek};
use std::path::Path;

/// Writes `NAME_0.mcap` and `metadata.yaml` into a folder called NAME.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, folder: &Path) -> anyhow::Result<String> {
    let name = folder.file_name().context("a folder with a name")?;
    let file_name = format!("{}_0.mcap", name.to_string_lossy());
    let path = folder.join(&file_name);
    let options = Options {
        compression: Some(Compression::Zstd),
        ..Options::default()
    };
    let mut file = LogFile::create_copy(&path, options)?;
    let mut channels = Vec::new();
    for topic in TOPICS {
        let channel = channel(&topic);
        channels.push((file.writer().declare(&channel)?, channel));
    }
    let mut translator = Translator::new(Style::Cdr, reader.robot()?);
    let mut span_ns = None;
    while let Some(entry) = reader.next_entry()? {
        let messages = translator.translate(&entry)?;
        write(&mut file, &mut channels, messages, &mut span_ns)?;
    }
    write(&mut file, &mut channels, translator.finish(), &mut span_ns)?;
    finish(file, &path)?;
    let channels: Vec<Channel> = channels.into_iter().map(|(_, channel)| channel).collect();
    let messages = channels.iter().map(|channel| channel.messages).sum();
    let yaml = yaml(&channels, messages, span_ns.unwrap_or_default(), &file_name);
    write_whole(&folder.join("metadata.yaml"), yaml.as_bytes())?;
    Ok(count(messages, "message", "messages"))
}

/// Writes messages, counts them and widens the span of their stamps.
fn write(
    file: &mut LogFile,
    channels: &mut [(ChannelId, Channel)],
    messages: Vec<Message>,
    span_ns: &mut Option<(i64, i64)>,
) -> anyhow::Result<()> {
    for message in messages {
        let mut channels = channels.iter_mut();
        let found = channels.find(|(_, channel)| channel.topic == message.topic);
        let Some((id, channel)) = found else { continue };
        let (sequence, time_ns) = (0, message.stamp_ns);
        let label = RecordHeader { sequence, time_ns };
        file.writer().write_bytes(*id, label, &message.bytes)?;
        channel.messages += 1;
        let (begin_ns, end_ns) = span_ns.unwrap_or((time_ns, time_ns));
        *span_ns = Some((begin_ns.min(time_ns), end_ns.max(time_ns)));
    }
    Ok(())
}

fn channel(topic: &Topic) -> Channel {
    let mut channel = topic.kind.channel(topic.name);
    let qos = if topic.is_latched {
        TRANSIENT_LOCAL
    } else {
        ""
    };
    channel.metadata.insert(QOS.to_owned(), qos.to_owned());
    channel
}

/// Where rosbag2 looks for the quality of service that a topic is published with.
const QOS: &str = "offered_qos_profiles";
/// That of what is said once: reliable, and kept for who subscribes late, as `tf2` and nav2 want
/// it; deadlines and lifespans are infinite. The numbers are those of `rmw`.
const TRANSIENT_LOCAL: &str = "- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";

/// What rosbag2 needs to know of the file. Writing to a String cannot fail.
fn yaml(channels: &[Channel], messages: u64, (begin_ns, end_ns): (i64, i64), file: &str) -> String {
    let span_ns = end_ns - begin_ns;
    let mut text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
             duration:\n    nanoseconds: {span_ns}\n  starting_time:\n    \
             nanoseconds_since_epoch: {begin_ns}\n  message_count: {messages}\n  \
             topics_with_message_count:\n"
    );
    for channel in channels {
        let (topic, kind, messages) = (&channel.topic, &channel.type_name, channel.messages);
        let qos = channel.metadata.get(QOS).map_or("", String::as_str);
        let qos = qos.replace('\n', "\\n");
        let _ = writeln!(
            text,
            "    - topic_metadata:\n        name: {topic}\n        type: {kind}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"{qos}\"\n      \
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
