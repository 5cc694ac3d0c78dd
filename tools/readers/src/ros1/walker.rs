//! Goes through the records of a bag's file, over damage to the next whole chunk.

use super::chunk::{ChunkHeader, find};
use super::record::{Fields, HEADER_MAX, Op};
use crate::Error;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Take};
use std::path::{Path, PathBuf};

/// First bytes of a bag of format 2.0.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Longest data of a record outside chunks that is kept: a connection's header with its message
/// definition.
const DATA_MAX: u64 = 1 << 20;
/// Bytes searched at a time for the next chunk.
const WINDOW: usize = 1 << 16;
/// Overlap of two windows: no header of a chunk is longer.
const OVERLAP: usize = 256;

/// What the walker came to.
#[derive(Debug)]
pub(super) enum Step {
    Chunk {
        header: ChunkHeader,
        /// Where its record begins.
        at: u64,
        /// Where its stored bytes begin.
        data_at: u64,
        /// Stored bytes, as far as the file has them.
        stored: u64,
        /// Stored bytes that the file has not.
        missing: u64,
    },
    /// Any other record; its data only where they are short.
    Record {
        op: Op,
        header: Vec<u8>,
        data: Vec<u8>,
    },
    /// Something that is no record, and where reading goes on; the end of the file where nowhere.
    Damage {
        at: u64,
        what: String,
        resumed: u64,
    },
    End,
}

/// A position in a bag's file.
#[derive(Debug)]
pub(super) struct Walker {
    file: BufReader<File>,
    pub path: PathBuf,
    pub length: u64,
    pub at: u64,
}

impl Walker {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(Error::io(path))?;
        let length = file.metadata().map_err(Error::io(path))?.len();
        Ok(Self {
            file: BufReader::with_capacity(WINDOW, file),
            path: path.to_owned(),
            length,
            at: MAGIC.len() as u64,
        })
    }

    /// The next record or damage; moves behind it.
    pub fn step(&mut self) -> Result<Step, Error> {
        let at = self.at;
        if at >= self.length {
            return Ok(Step::End);
        }
        match self.record(at)? {
            Ok(step) => Ok(step),
            Err(what) => self.damage(at, at + 1, what),
        }
    }

    /// Declares what lies at `at` damaged and goes on with the next chunk that begins at or after
    /// `from`.
    pub fn damage(&mut self, at: u64, from: u64, what: String) -> Result<Step, Error> {
        let resumed = self.find_chunk(from)?;
        self.at = resumed;
        Ok(Step::Damage { at, what, resumed })
    }

    /// A chunk's stored bytes.
    pub fn stored(
        &mut self,
        data_at: u64,
        stored: u64,
    ) -> Result<Take<&mut BufReader<File>>, Error> {
        self.seek(data_at)?;
        Ok((&mut self.file).take(stored))
    }

    fn record(&mut self, at: u64) -> Result<Result<Step, String>, Error> {
        self.seek(at)?;
        let Some(header_length) = self.u32()? else {
            return Ok(Err("file ends within a record".to_owned()));
        };
        if header_length as usize > HEADER_MAX {
            return Ok(Err(format!(
                "record header of {header_length} bytes, {HEADER_MAX} at most"
            )));
        }
        let header = self.bytes(u64::from(header_length))?;
        let fields = Fields::parse(&header).filter(|_| header.len() == header_length as usize);
        let Some((fields, op)) = fields.and_then(|fields| Some((fields, fields.op()?))) else {
            return Ok(Err("no record header of a bag".to_owned()));
        };
        let Some(data_length) = self.u32()? else {
            return Ok(Err("file ends within a record".to_owned()));
        };
        let data_at = at + 8 + header.len() as u64;
        let data_length = u64::from(data_length);
        let stored = data_length.min(self.length.saturating_sub(data_at));
        let missing = data_length - stored;

        let step = if op == Op::Chunk {
            let Some(header) = ChunkHeader::from_fields(&fields) else {
                return Ok(Err(
                    "chunk of unknown compression or above 256 MiB".to_owned()
                ));
            };
            Step::Chunk {
                header,
                at,
                data_at,
                stored,
                missing,
            }
        } else if missing > 0 {
            return Ok(Err(format!(
                "record of {data_length} bytes, {stored} are left"
            )));
        } else {
            let data = if stored <= DATA_MAX {
                self.bytes(stored)?
            } else {
                Vec::new()
            };
            Step::Record { op, header, data }
        };
        self.at = data_at + stored;
        Ok(Ok(step))
    }

    /// Where the next chunk begins, from `from` on; the end of the file where there is none.
    fn find_chunk(&mut self, mut from: u64) -> Result<u64, Error> {
        while from < self.length {
            self.seek(from)?;
            let window = self.bytes((WINDOW + OVERLAP) as u64)?;
            if let Some(found) = find(&window) {
                return Ok(from + found as u64);
            }
            from += WINDOW as u64;
        }
        Ok(self.length)
    }

    fn seek(&mut self, at: u64) -> Result<(), Error> {
        self.file
            .seek(SeekFrom::Start(at))
            .map_err(Error::io(&self.path))?;
        Ok(())
    }

    /// Up to `count` bytes, fewer at the end of the file.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::new();
        let read = (&mut self.file).take(count).read_to_end(&mut bytes);
        read.map_err(Error::io(&self.path))?;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<Option<u32>, Error> {
        let bytes = self.bytes(4)?;
        Ok(bytes.first_chunk().map(|bytes| u32::from_le_bytes(*bytes)))
    }
}
