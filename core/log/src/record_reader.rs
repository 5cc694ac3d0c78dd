//! Reads a log's records one after the other; what is damaged is counted and stepped over.

use crate::Error;
use crate::chunk::{Chunk, FRAME, SIZE_MAX, START_BYTES, is_chunk_start};
use crate::damage::{Damage, DamageKind, count};
use mcap::records::op;
use std::io::{Read, Seek, SeekFrom};

/// The records of a file, those in chunks among them, in the file's order.
pub(crate) struct RecordReader<R> {
    pub path: String,
    source: R,
    /// Bytes of the file, and where the next record outside chunks begins.
    pub length: u64,
    pub position: u64,
    chunk: Option<(u64, Chunk)>,
    /// The content of the last record.
    pub record: Vec<u8>,
    spare: Vec<u8>,
    pub damage: Vec<Damage>,
    whole_chunks_only: bool,
    ended: bool,
}

impl<R: Read + Seek> RecordReader<R> {
    /// Begins to read; `path` is named in errors.
    pub fn new(source: R, path: String) -> Result<Self, Error> {
        let mut reader = Self {
            path,
            source,
            length: 0,
            position: 0,
            chunk: None,
            record: Vec::new(),
            spare: Vec::new(),
            damage: Vec::new(),
            whole_chunks_only: false,
            ended: false,
        };
        reader.length = reader.seek(SeekFrom::End(0))?;
        reader.seek(SeekFrom::Start(0))?;
        let found = reader.read(mcap::MAGIC.len() as u64, Vec::new())?;
        if found != mcap::MAGIC {
            let path = reader.path;
            return Err(Error::NotMcap { path, found });
        }
        reader.position = mcap::MAGIC.len() as u64;
        Ok(reader)
    }

    /// The next record before the first chunk and the first message; `None` where one of these
    /// comes.
    pub fn next_before_data(&mut self) -> Result<Option<(u8, u64)>, Error> {
        match self.next_file_record()? {
            Some((op::MESSAGE, offset)) => {
                // A log without chunks: this message is read again as the first one.
                self.position = offset;
                self.seek(SeekFrom::Start(offset))?;
                Ok(None)
            }
            found => Ok(found),
        }
    }

    /// From now on a chunk that is cut gives nothing.
    pub fn whole_chunks_only(&mut self) {
        self.whole_chunks_only = true;
        if self.chunk.as_ref().is_some_and(|(_, chunk)| chunk.is_cut()) {
            self.chunk = None;
        }
    }

    /// Brings the next record of any kind into `record`: its opcode and the offset to name.
    pub fn next_record(&mut self) -> Result<Option<(u8, u64)>, Error> {
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
                Err(error) => self.count(DamageKind::Chunk, offset, || format!("chunk: {error}")),
            }
            let ended = self.chunk.take().map(|(_, chunk)| chunk.into_memory());
            self.spare = ended.unwrap_or_default();
        }
    }

    /// As [`Self::next_record`], outside chunks. `None` with `self.chunk` set means: read that
    /// one.
    fn next_file_record(&mut self) -> Result<Option<(u8, u64)>, Error> {
        while !self.ended {
            let offset = self.position;
            let frame = self.read(FRAME as u64, Vec::new())?;
            let (Some(&opcode), Some(length), FRAME) =
                (frame.first(), frame.last_chunk(), frame.len())
            else {
                self.count(DamageKind::Cut, offset, || {
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
                        self.count(DamageKind::Cut, offset, || {
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
                    self.count(DamageKind::Chunk, offset, || {
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
                    let kind = match cut {
                        true => DamageKind::Cut,
                        false => DamageKind::Record,
                    };
                    self.count(kind, offset, || {
                        format!("record of kind {opcode:#04x} and {length} bytes, the file has {rest} more")
                    });
                    self.ended = !resumed;
                }
            }
        }
        Ok(None)
    }

    fn open_chunk(&mut self, body: Vec<u8>, cut: bool, offset: u64) {
        if cut && self.whole_chunks_only {
            return;
        }
        match Chunk::new(body, cut) {
            Ok(chunk) => self.chunk = Some((offset, chunk)),
            // The cut itself is already counted.
            Err(_) if cut => {}
            Err(error) => self.count(DamageKind::Chunk, offset, || format!("chunk: {error}")),
        }
    }

    /// Goes to the next chunk at or behind `from`; false where there is none.
    fn resync(&mut self, from: u64) -> Result<bool, Error> {
        const WINDOW: usize = 1 << 16;
        let mut start = from;
        while start < self.length {
            let window = self.read_at(start, WINDOW as u64)?;
            let starts = window.len().saturating_sub(START_BYTES - 1);
            let found =
                (0..starts).find(|&at| is_chunk_start(window.get(at..).unwrap_or_default()));
            if let Some(at) = found {
                self.position = start + at as u64;
                self.seek(SeekFrom::Start(self.position))?;
                return Ok(true);
            }
            if window.len() < WINDOW {
                break;
            }
            start += starts as u64;
        }
        Ok(false)
    }

    /// Counts damage at an offset.
    pub fn count(&mut self, kind: DamageKind, offset: u64, text: impl FnOnce() -> String) {
        let path = &self.path;
        count(&mut self.damage, kind, || {
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
        let read = self.source.by_ref().take(wanted).read_to_end(&mut bytes);
        read.map_err(Error::io(&*self.path))?;
        Ok(bytes)
    }

    fn seek(&mut self, to: SeekFrom) -> Result<u64, Error> {
        self.source.seek(to).map_err(Error::io(&*self.path))
    }
}
