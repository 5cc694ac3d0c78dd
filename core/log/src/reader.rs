//! Reads a log from its beginning to its end, chunk by chunk; memory does not grow with the file.

use crate::channel::Channel;
use crate::damage::{Damage, DamageKind};
use crate::entry::Entry;
use crate::lengths::lengths_fit;
use crate::record_reader::RecordReader;
use crate::translation::Translation;
use crate::{CONFIG_METADATA, CONFIG_TOML, Error, ROBOT_METADATA, Robot};
use mcap::records::{Record, op};
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// A message record's header: channel, sequence, log time, publish time.
const MESSAGE_HEADER: usize = 2 + 4 + 8 + 8;

/// Reads messages in the file's order. Damage is counted and stepped over; a cut file gives what
/// is there.
pub struct LogReader<R> {
    records: RecordReader<R>,
    written_by: String,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Known>,
}

/// A channel, and how its messages become those of this build, where that was asked for.
type Known = (Channel, OnceCell<Option<Translation>>);

/// Name, encoding and text of a schema.
type Schema = (String, String, Vec<u8>);

impl LogReader<BufReader<File>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let shown = path.display().to_string();
        let file = File::open(path).map_err(Error::io(&*shown))?;
        Self::new(BufReader::with_capacity(1 << 16, file), shown)
    }
}

impl<R: Read + Seek> LogReader<R> {
    /// Begins to read, up to the first chunk; `path` is named in errors.
    pub fn new(source: R, path: impl Into<String>) -> Result<Self, Error> {
        let mut reader = Self {
            records: RecordReader::new(source, path.into())?,
            written_by: "unknown".to_owned(),
            metadata: BTreeMap::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        };
        while let Some((opcode, offset)) = reader.records.next_before_data()? {
            reader.take_in(opcode, offset);
        }
        Ok(reader)
    }

    /// From now on a chunk that is cut gives nothing: what it holds has no checksum.
    pub fn whole_chunks_only(&mut self) {
        self.records.whole_chunks_only();
    }

    /// The next message, `None` at the end. An error is the operating system's and ends the
    /// reading.
    pub fn next_entry(&mut self) -> Result<Option<Entry<'_>>, Error> {
        loop {
            let Some((opcode, offset)) = self.records.next_record()? else {
                return Ok(None);
            };
            if opcode != op::MESSAGE {
                self.take_in(opcode, offset);
                continue;
            }
            let record = &self.records.record;
            let id = record.first_chunk().copied().map_or(0, u16::from_le_bytes);
            let known = record.len() >= MESSAGE_HEADER && self.channels.contains_key(&id);
            if !known {
                self.records.count(DamageKind::Channel, offset, || {
                    format!("message of the unknown channel {id}")
                });
                continue;
            }
            return Ok(self.entry(id, offset));
        }
    }

    /// A metadata record by name, as far as the file was read: all that stand before the first
    /// message.
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(name)
    }

    /// All metadata records, as far as the file was read.
    pub fn all_metadata(&self) -> &BTreeMap<String, BTreeMap<String, String>> {
        &self.metadata
    }

    /// The robot that the log was recorded on; the default where the log does not name it.
    pub fn robot(&self) -> Result<Robot, Error> {
        self.metadata
            .get(ROBOT_METADATA)
            .map_or(Ok(Robot::default()), |map| {
                Robot::from_metadata(map, &self.records.path)
            })
    }

    /// The configuration that a live run was recorded with, as TOML.
    pub fn configuration(&self) -> Option<&str> {
        let record = self.metadata.get(CONFIG_METADATA)?;
        record.get(CONFIG_TOML).map(String::as_str)
    }

    /// The program that wrote the log, as the log names it.
    pub fn written_by(&self) -> &str {
        &self.written_by
    }

    /// The topics found so far, with the number of their messages.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.values().map(|(channel, _)| channel)
    }

    /// The topics that were read although the log has them in another build's layout, each with
    /// what it lacks.
    pub fn translated(&self) -> impl Iterator<Item = String> {
        self.channels.values().filter_map(|(channel, translation)| {
            let translation = translation.get()?.as_ref()?;
            let mut text = format!(
                "{}: {} was written by another build ({})",
                self.records.path, channel.topic, self.written_by
            );
            for (names, what) in [
                (&translation.lacking, "it has no"),
                (&translation.unread, "this one does not know its"),
            ] {
                if !names.is_empty() {
                    text += &format!("; {what} {}", names.join(", "));
                }
            }
            Some(text)
        })
    }

    /// The damage found so far.
    pub fn damage(&self) -> &[Damage] {
        &self.records.damage
    }

    /// Bytes of the file and how many of them are read, for a progress bar.
    pub fn progress(&self) -> (u64, u64) {
        (self.records.position, self.records.length)
    }

    /// Keeps the content of a record other than a message.
    fn take_in(&mut self, opcode: u8, offset: u64) {
        if !lengths_fit(opcode, &self.records.record) {
            self.records.count(DamageKind::Record, offset, || {
                format!("record of kind {opcode:#04x}: a length inside it is beyond its end")
            });
            return;
        }
        match mcap::parse_record(opcode, &self.records.record) {
            Ok(Record::Header(header)) => self.written_by = header.library,
            Ok(Record::Metadata(record)) => {
                self.metadata.insert(record.name, record.metadata);
            }
            Ok(Record::Schema { header, data }) => {
                let schema = (header.name, header.encoding, data.into_owned());
                self.schemas.insert(header.id, schema);
            }
            Ok(Record::Channel(record)) => {
                // Every chunk may declare it again.
                if self.channels.contains_key(&record.id) {
                    return;
                }
                let schema = self.schemas.get(&record.schema_id).cloned();
                let (type_name, schema_encoding, schema) = schema.unwrap_or_default();
                let channel = Channel {
                    topic: record.topic,
                    type_name,
                    message_encoding: record.message_encoding,
                    schema_encoding,
                    schema,
                    metadata: record.metadata,
                    messages: 0,
                };
                self.channels.insert(record.id, (channel, OnceCell::new()));
            }
            Ok(_) => {}
            Err(error) => {
                self.records.count(DamageKind::Record, offset, || {
                    format!("record of kind {opcode:#04x}: {error}")
                });
            }
        }
    }

    fn entry(&mut self, id: u16, offset: u64) -> Option<Entry<'_>> {
        let (channel, translation) = self.channels.get_mut(&id)?;
        channel.messages += 1;
        let (header, bytes) = self.records.record.split_at_checked(MESSAGE_HEADER)?;
        Some(Entry {
            channel,
            sequence: u32::from_le_bytes(*header.get(2..)?.first_chunk()?),
            time_ns: i64::from_le_bytes(*header.get(6..)?.first_chunk()?),
            offset,
            bytes,
            path: &self.records.path,
            written_by: &self.written_by,
            translation,
        })
    }
}

impl<R> std::fmt::Debug for LogReader<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LogReader")
            .field("path", &self.records.path)
            .field("position", &self.records.position)
            .finish_non_exhaustive()
    }
}
