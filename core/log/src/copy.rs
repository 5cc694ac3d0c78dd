//! A log, or a section of one, written anew.

use crate::{Channel, ChannelId, Entry, Error, LogReader, LogWriter};
use std::io::{Read, Seek, Write};

/// Copies a log to a new one: metadata, channels of any encoding, and the messages for which
/// `keep` is true, bit for bit. Damage is stepped over, as by every reader. Gives the number of
/// messages.
pub fn copy<R: Read + Seek, W: Write + Seek>(
    reader: &mut LogReader<R>,
    writer: &mut LogWriter<W>,
    mut keep: impl FnMut(&Entry<'_>) -> bool,
) -> Result<u64, Error> {
    let first = reader.all_metadata().clone();
    for (name, says) in &first {
        writer.write_metadata(name, says.clone())?;
    }
    let mut channels: Vec<(Channel, ChannelId)> = Vec::new();
    let mut copied = 0;
    while let Some(entry) = reader.next_entry()? {
        if !keep(&entry) {
            continue;
        }
        let known = channels.iter().find(|(channel, _)| {
            channel.topic == entry.channel.topic
                && channel.type_name == entry.channel.type_name
                && channel.message_encoding == entry.channel.message_encoding
        });
        let id = match known {
            Some((_, id)) => *id,
            None => {
                let id = writer.declare(entry.channel)?;
                channels.push((entry.channel.clone(), id));
                id
            }
        };
        writer.write_bytes(id, entry.record_header(), entry.bytes)?;
        copied += 1;
    }
    // Records that stand behind the first message.
    for (name, says) in reader.all_metadata() {
        if first.get(name) != Some(says) {
            writer.write_metadata(name, says.clone())?;
        }
    }
    Ok(copied)
}
