//! Writes a log into anything that can seek.

use crate::{Error, description::describe};
use mcap::records::{MessageHeader, Metadata};
use randt_messages::{MessageRef, Topic};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// How a log's chunks are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Quick to write and to read.
    #[default]
    Lz4,
    /// About two thirds of lz4's size, at half its speed.
    Zstd,
}

/// How a log is written.
#[derive(Clone, Debug)]
pub struct Options {
    /// Compression of chunks.
    pub compression: Compression,
    /// Program and version that writes, for whoever finds a layout that he does not know.
    pub written_by: String,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            compression: Compression::default(),
            written_by: concat!("randt-log ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }
}

/// Writes messages in the order in which they come; a topic's channel begins with its first message.
///
/// Call [`LogWriter::finish`]: what is merely dropped loses its errors.
pub struct LogWriter<W: Write + Seek> {
    path: String,
    inner: mcap::Writer<W>,
    // A handful of topics: a list is the quickest map.
    channels: Vec<(&'static str, u16)>,
    bytes: Vec<u8>,
}

impl<W: Write + Seek> LogWriter<W> {
    /// Begins a log; `path` is named in errors.
    pub fn new(sink: W, path: impl Into<String>, options: Options) -> Result<Self, Error> {
        let path = path.into();
        let compression = match options.compression {
            Compression::None => None,
            Compression::Lz4 => Some(mcap::Compression::Lz4),
            Compression::Zstd => Some(mcap::Compression::Zstd),
        };
        let created = mcap::WriteOptions::new()
            .profile("randt")
            .library(options.written_by)
            .compression(compression)
            // No threads: the same bytes on every machine, and a recorder that stays on its core.
            .compression_threads(0)
            .create(sink);
        match created {
            Ok(inner) => Ok(Self {
                path,
                inner,
                channels: Vec::new(),
                bytes: Vec::new(),
            }),
            Err(cause) => Err(Error::Write {
                path,
                cause: Box::new(cause),
            }),
        }
    }

    /// Writes a record of names and values. Write it before the first message: whoever reads a log that
    /// was cut has only what stands before the cut.
    pub fn write_metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), Error> {
        let record = Metadata {
            name: name.to_owned(),
            metadata,
        };
        let result = self.inner.write_metadata(&record);
        self.check(result)
    }

    /// Writes a message.
    pub fn write<T: Topic>(&mut self, message: MessageRef<'_, T>) -> Result<(), Error> {
        let channel_id = self.channel::<T>()?;
        let header = message.header();
        // MCAP has no negative times.
        let time_ns = u64::try_from(header.stamp_ns).unwrap_or(0);
        let record = MessageHeader {
            channel_id,
            // MCAP has 32 bits for it; the message itself holds all 64.
            sequence: header.sequence as u32,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.bytes.clear();
        message.write_bytes(&mut self.bytes);
        let result = self.inner.write_to_known_channel(&record, &self.bytes);
        self.check(result)
    }

    /// Ends the chunk, so that a reader of the file as it now is gets everything; does not fsync.
    pub fn flush(&mut self) -> Result<(), Error> {
        let result = self.inner.flush();
        self.check(result)
    }

    /// Ends the log and gives the sink back, flushed.
    pub fn finish(mut self) -> Result<W, Error> {
        let result = self.inner.finish().map(|_| ());
        self.check(result)?;
        let mut sink = self.inner.into_inner();
        match sink.flush() {
            Ok(()) => Ok(sink),
            Err(cause) => Err(Error::Io {
                path: self.path,
                cause,
            }),
        }
    }

    fn channel<T: Topic>(&mut self) -> Result<u16, Error> {
        if let Some((_, id)) = self.channels.iter().find(|(name, _)| *name == T::NAME) {
            return Ok(*id);
        }
        let schema = describe::<T>();
        let added = self
            .inner
            .add_schema(T::TYPE_NAME, "randt-layout", schema.as_bytes())
            .and_then(|id| {
                self.inner
                    .add_channel(id, T::NAME, "randt", &BTreeMap::new())
            });
        match added {
            Ok(id) => {
                self.channels.push((T::NAME, id));
                Ok(id)
            }
            Err(cause) => Err(self.failed(cause)),
        }
    }

    fn check(&self, result: mcap::McapResult<()>) -> Result<(), Error> {
        result.map_err(|cause| self.failed(cause))
    }

    fn failed(&self, cause: mcap::McapError) -> Error {
        let path = self.path.clone();
        match cause {
            mcap::McapError::Io(cause) => Error::Io { path, cause },
            cause => Error::Write {
                path,
                cause: Box::new(cause),
            },
        }
    }
}

impl<W: Write + Seek> std::fmt::Debug for LogWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LogWriter")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}
