//! Reads a log from its beginning to its end, chunk by chunk; memory does not grow with the file.

use crate::chunk::{Chunk, FRAME, LOOK, SIZE_MAX, looks_like_chunk};
use crate::damage::{Damage, DamageKind, note};
use crate::entry::{Channel, Entry};
use crate::lengths::lengths_fit;
use crate::translation::Translation;
use crate::{CONFIG_METADATA, CONFIG_TOML, Error, ROBOT_METADATA, Robot};
use mcap::records::{Record, op};
use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// A message record's header: channel, sequence, log time, publish time.
const MESSAGE_HEADER: usize = 2 + 4 + 8 + 8;

/// Reads messages in the file's order. Damage is counted and stepped over; a cut file gives what is there.
pub struct LogReader<R> {
    path: String,
    source: R,
    length: u64,
    /// Where the next record outside chunks begins.
    position: u64,
    chunk: Option<(u64, Chunk)>,
    record: Vec<u8>,
    spare: Vec<u8>,
    written_by: String,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Known>,
    damage: Vec<Damage>,
    whole_chunks_only: bool,
    ended: bool,
}

/// A channel, and how its messages become those of this build, where that was asked for.
struct Known {
    channel: Channel,
    translation: OnceCell<Option<Translation>>,
}

/// Name, encoding and text of a schema.
type Schema = (String, String, Vec<u8>);

impl LogReader<BufReader<File>> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let shown = path.display().to_string();
        match File::open(path) {
            Ok(file) => Self::new(BufReader::with_capacity(1 << 16, file), shown),
            Err(cause) => Err(Error::Io { path: shown, cause }),
        }
    }
}

impl<R: Read + Seek> LogReader<R> {
    /// Begins to read, up to the first chunk; `path` is named in errors.
    pub fn new(source: R, path: impl Into<String>) -> Result<Self, Error> {
        let mut reader = Self {
            path: path.into(),
            source,
            length: 0,
            position: 0,
            chunk: None,
            record: Vec::new(),
            spare: Vec::new(),
            written_by: "unknown".to_owned(),
            metadata: BTreeMap::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            damage: Vec::new(),
            whole_chunks_only: false,
            ended: false,
        };
        reader.begin()?;
        Ok(reader)
    }

    /// From now on a chunk that is cut gives nothing: what it holds has no checksum.
    pub fn whole_chunks_only(&mut self) {
        self.whole_chunks_only = true;
        if self.chunk.as_ref().is_some_and(|(_, chunk)| chunk.is_cut()) {
            self.chunk = None;
        }
    }

    /// The next message, `None` at the end. An error is the operating system's and ends the reading.
    pub fn next_entry(&mut self) -> Result<Option<Entry<'_>>, Error> {
        loop {
            let Some((opcode, offset)) = self.next_record()? else {
                return Ok(None);
            };
            if opcode != op::MESSAGE {
                self.take_in(opcode, offset);
                continue;
            }
            let id = self
                .record
                .first_chunk()
                .map_or(0, |bytes| u16::from_le_bytes(*bytes));
            let known = self.record.len() >= MESSAGE_HEADER && self.channels.contains_key(&id);
            if !known {
                self.note(DamageKind::Channel, offset, || {
                    format!("message of the unknown channel {id}")
                });
                continue;
            }
            return Ok(self.entry(id, offset));
        }
    }

    /// A metadata record by name, as far as the file was read: all that stand before the first message.
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(name)
    }

    /// All metadata records, as far as the file was read.
    pub fn all_metadata(&self) -> &BTreeMap<String, BTreeMap<String, String>> {
        &self.metadata
    }

    /// The robot that the log was recorded on; nothing known where the log does not say.
    pub fn robot(&self) -> Result<Robot, Error> {
        self.metadata
            .get(ROBOT_METADATA)
            .map_or(Ok(Robot::default()), |map| {
                Robot::from_metadata(map, &self.path)
            })
    }

    /// The configuration that a live run was recorded with, as TOML.
    pub fn configuration(&self) -> Option<&str> {
        let record = self.metadata.get(CONFIG_METADATA)?;
        record.get(CONFIG_TOML).map(String::as_str)
    }

    /// What the log says of the program that wrote it.
    pub fn written_by(&self) -> &str {
        &self.written_by
    }

    /// The topics met so far, with the number of their messages.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.values().map(|known| &known.channel)
    }

    /// The topics that were read although the log has them in another build's layout, each with what it lacks.
    pub fn translated(&self) -> impl Iterator<Item = String> {
        self.channels.values().filter_map(|known| {
            let translation = known.translation.get()?.as_ref()?;
            let mut text = format!(
                "{}: {} was written by another build ({})",
                self.path, known.channel.topic, self.written_by
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

    /// The damage met so far.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// Bytes of the file and how many of them are read, for a progress bar.
    pub fn progress(&self) -> (u64, u64) {
        (self.position, self.length)
    }

    fn begin(&mut self) -> Result<(), Error> {
        self.length = self.seek(SeekFrom::End(0))?;
        self.seek(SeekFrom::Start(0))?;
        let found = self.read(mcap::MAGIC.len() as u64, Vec::new())?;
        if found != mcap::MAGIC {
            return Err(Error::NotMcap {
                path: self.path.clone(),
                found,
            });
        }
        self.position = mcap::MAGIC.len() as u64;
        while self.chunk.is_none() && !self.ended {
            let Some((opcode, offset)) = self.next_file_record()? else {
                break;
            };
            if opcode == op::MESSAGE {
                // A log without chunks: this message is read again as the first one.
                self.position = offset;
                self.seek(SeekFrom::Start(offset))?;
                break;
            }
            self.take_in(opcode, offset);
        }
        Ok(())
    }

    /// Brings the next record of any kind into `self.record`: its opcode and the offset to name.
    fn next_record(&mut self) -> Result<Option<(u8, u64)>, Error> {
        loop {
            let Some((offset, chunk)) = &mut self.chunk else {
                match self.next_file_record()? {
                    Some(found) => return Ok(Some(found)),
                    None if self.chunk.is_some() => continue,
                    None => return Ok(None),
                }
            };
            let offset = *offset;
            match chunk.next_record(&mut self.record) {
                Ok(Some(opcode)) => return Ok(Some((opcode, offset))),
                Ok(None) => {}
                Err(error) => self.note(DamageKind::Chunk, offset, || format!("chunk: {error}")),
            }
            self.spare = self
                .chunk
                .take()
                .map(|(_, chunk)| chunk.into_memory())
                .unwrap_or_default();
        }
    }

    /// As [`Self::next_record`], outside chunks. `None` with `self.chunk` set means: read that one.
    fn next_file_record(&mut self) -> Result<Option<(u8, u64)>, Error> {
        while !self.ended {
            let offset = self.position;
            let frame = self.read(FRAME as u64, Vec::new())?;
            let (Some(&opcode), Some(length), FRAME) =
                (frame.first(), frame.last_chunk(), frame.len())
            else {
                self.note(DamageKind::Cut, offset, || {
                    format!(
                        "the file ends here, without a data end record ({} bytes of one)",
                        frame.len()
                    )
                });
                self.ended = true;
                break;
            };
            let length = u64::from_le_bytes(*length);
            let rest = self.length.saturating_sub(offset + FRAME as u64);
            let end = offset.saturating_add(FRAME as u64).saturating_add(length);
            match opcode {
                op::DATA_END if length == 4 => self.ended = true,
                op::CHUNK if length > rest => {
                    if !self.resync(offset + 1)? {
                        let record =
                            self.read_at(offset, rest.min(SIZE_MAX as u64) + FRAME as u64)?;
                        self.note(DamageKind::Cut, offset, || {
                            if length == u64::MAX {
                                // The writer sets the length when the chunk is full.
                                format!(
                                    "an unfinished chunk of {rest} bytes: its writer was stopped"
                                )
                            } else {
                                format!("chunk of {length} bytes, the file has {rest} more")
                            }
                        });
                        self.ended = true;
                        self.open_chunk(record, true, offset);
                        return Ok(None);
                    }
                    self.note(DamageKind::Chunk, offset, || {
                        format!("chunk of {length} bytes, the file has {rest} more")
                    });
                }
                op::CHUNK if length <= SIZE_MAX as u64 => {
                    let record = self.read_at(offset, FRAME as u64 + length)?;
                    self.position = end;
                    self.open_chunk(record, false, offset);
                    if self.chunk.is_some() {
                        return Ok(None);
                    }
                }
                op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA | op::MESSAGE
                    if length <= rest.min(SIZE_MAX as u64) =>
                {
                    self.record = self.read(length, Vec::new())?;
                    self.position = end;
                    return Ok(Some((opcode, offset)));
                }
                // Indexes, attachments and private records.
                op::MESSAGE_INDEX
                | op::CHUNK_INDEX
                | op::ATTACHMENT..=op::SUMMARY_OFFSET
                | 0x80..
                    if length <= rest =>
                {
                    self.position = end;
                    self.seek(SeekFrom::Start(end))?;
                }
                _ => {
                    let resumed = self.resync(offset + 1)?;
                    let cut = !resumed && length > rest;
                    let kind = if cut {
                        DamageKind::Cut
                    } else {
                        DamageKind::Record
                    };
                    self.note(kind, offset, || {
                        format!("record of kind {opcode:#04x} and {length} bytes, the file has {rest} more")
                    });
                    self.ended = !resumed;
                }
            }
        }
        Ok(None)
    }

    fn open_chunk(&mut self, body: Vec<u8>, cut: bool, offset: u64) {
        match Chunk::new(body, cut) {
            Ok(chunk) => self.chunk = Some((offset, chunk)),
            // The cut itself is already counted.
            Err(_) if cut => {}
            Err(error) => self.note(DamageKind::Chunk, offset, || format!("chunk: {error}")),
        }
    }

    /// Goes to the next chunk at or behind `from`; false where there is none.
    fn resync(&mut self, from: u64) -> Result<bool, Error> {
        const WINDOW: usize = 1 << 16;
        let mut start = from;
        while start < self.length {
            let window = self.read_at(start, WINDOW as u64)?;
            let places = window.len().saturating_sub(LOOK - 1);
            let found =
                (0..places).find(|&at| looks_like_chunk(window.get(at..).unwrap_or_default()));
            if let Some(at) = found {
                self.position = start + at as u64;
                self.seek(SeekFrom::Start(self.position))?;
                return Ok(true);
            }
            if window.len() < WINDOW {
                break;
            }
            start += places as u64;
        }
        Ok(false)
    }

    /// Keeps what a record other than a message says.
    fn take_in(&mut self, opcode: u8, offset: u64) {
        if !lengths_fit(opcode, &self.record) {
            self.note(DamageKind::Record, offset, || {
                format!("record of kind {opcode:#04x}: a length inside it is beyond its end")
            });
            return;
        }
        match mcap::parse_record(opcode, &self.record) {
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
                    messages: 0,
                };
                let translation = OnceCell::new();
                self.channels.insert(
                    record.id,
                    Known {
                        channel,
                        translation,
                    },
                );
            }
            Ok(_) => {}
            Err(error) => {
                self.note(DamageKind::Record, offset, || {
                    format!("record of kind {opcode:#04x}: {error}")
                });
            }
        }
    }

    fn entry(&mut self, id: u16, offset: u64) -> Option<Entry<'_>> {
        let Known {
            channel,
            translation,
        } = self.channels.get_mut(&id)?;
        channel.messages += 1;
        let (header, bytes) = self.record.split_at_checked(MESSAGE_HEADER)?;
        Some(Entry {
            channel,
            sequence: u32::from_le_bytes(*header.get(2..)?.first_chunk()?),
            time_ns: i64::from_le_bytes(*header.get(6..)?.first_chunk()?),
            offset,
            bytes,
            path: &self.path,
            written_by: &self.written_by,
            translation,
        })
    }

    fn note(&mut self, kind: DamageKind, offset: u64, text: impl FnOnce() -> String) {
        let path = &self.path;
        note(&mut self.damage, kind, || {
            format!("{path}: offset {offset}: {}", text())
        });
    }

    fn read_at(&mut self, offset: u64, wanted: u64) -> Result<Vec<u8>, Error> {
        self.seek(SeekFrom::Start(offset))?;
        let spare = std::mem::take(&mut self.spare);
        self.read(wanted, spare)
    }

    /// Up to `wanted` bytes into `bytes`; fewer only at the end of the file.
    fn read(&mut self, wanted: u64, mut bytes: Vec<u8>) -> Result<Vec<u8>, Error> {
        bytes.clear();
        match self.source.by_ref().take(wanted).read_to_end(&mut bytes) {
            Ok(_) => Ok(bytes),
            Err(cause) => Err(Error::Io {
                path: self.path.clone(),
                cause,
            }),
        }
    }

    fn seek(&mut self, to: SeekFrom) -> Result<u64, Error> {
        self.source.seek(to).map_err(|cause| Error::Io {
            path: self.path.clone(),
            cause,
        })
    }
}

impl<R> std::fmt::Debug for LogReader<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LogReader")
            .field("path", &self.path)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}
