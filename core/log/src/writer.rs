//! Writes a log into anything that can seek.

use crate::{Channel, Error, RecordHeader, write_cdr};
use mcap::Compression;
use mcap::records::{MessageHeader, Metadata};
use randt_messages::{MessageRef, Topic};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// How a log is written.
#[derive(Clone, Debug)]
pub struct Options {
    /// Compression of chunks: lz4 is quick to write and to read; zstd has about two thirds of its
    /// size, at half its speed.
    pub compression: Option<Compression>,
    /// Level of the compression; 0 leaves it to the library.
    pub level: u32,
    /// A chunk ends when it has more bytes than this, before compression.
    pub chunk_bytes: u64,
    /// What MCAP calls a profile: whose conventions the log follows.
    pub profile: &'static str,
    /// Program, version and commit that write the log.
    pub written_by: String,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            compression: Some(Compression::Lz4),
            level: 0,
            // MCAP's own default.
            chunk_bytes: 1 << 20,
            // Ours are serialised as those of ROS 2 are.
            profile: "ros2",
            written_by: concat!("randt-log ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }
}

/// Writes messages in the order in which they come; a topic's channel begins with its first
/// message.
///
/// Call [`LogWriter::finish`]: what is merely dropped loses its errors.
pub struct LogWriter<W: Write + Seek> {
    path: String,
    inner: mcap::Writer<W>,
    // A handful of topics: a list is the quickest map.
    channels: Vec<(&'static str, ChannelId)>,
    bytes: Vec<u8>,
}

/// A channel that a log has declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelId(u16);

impl<W: Write + Seek> LogWriter<W> {
    /// Begins a log; `path` is named in errors.
    pub fn new(sink: W, path: impl Into<String>, options: Options) -> Result<Self, Error> {
        Self::with(sink, path, options, false)
    }

    /// The same; `append_only`: chunks are put together in memory, and nothing that was written is
    /// ever changed.
    pub(crate) fn with(
        sink: W,
        path: impl Into<String>,
        options: Options,
        append_only: bool,
    ) -> Result<Self, Error> {
        let path = path.into();
        let created = mcap::WriteOptions::new()
            .profile(options.profile)
            .library(options.written_by)
            .compression(options.compression)
            .compression_level(options.level)
            .chunk_size(Some(options.chunk_bytes))
            .disable_seeking(append_only)
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

    /// Writes a record of names and values. Write it before the first message: the reader of a log
    /// that was cut has only what stands before the cut.
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
        let channel = self.channel::<T>()?;
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        write_cdr(message, &mut bytes);
        let result = self.write_bytes(channel, RecordHeader::from_header(message.header()), &bytes);
        self.bytes = bytes;
        result
    }

    /// Declares a channel of any encoding; the same one twice is one.
    pub fn declare(&mut self, channel: &Channel) -> Result<ChannelId, Error> {
        let schema = match channel.schema_encoding.as_str() {
            "" => Ok(0),
            encoding => (self.inner).add_schema(&channel.type_name, encoding, &channel.schema),
        };
        let added = schema.and_then(|schema| {
            let (topic, encoding) = (&channel.topic, &channel.message_encoding);
            (self.inner).add_channel(schema, topic, encoding, &channel.metadata)
        });
        added.map(ChannelId).map_err(|cause| self.failed(cause))
    }

    /// Writes a message that is bytes already.
    pub fn write_bytes(
        &mut self,
        channel: ChannelId,
        record: RecordHeader,
        bytes: &[u8],
    ) -> Result<(), Error> {
        // MCAP has no negative times.
        let time = u64::try_from(record.time_ns).unwrap_or(0);
        let record = MessageHeader {
            channel_id: channel.0,
            sequence: record.sequence,
            log_time: time,
            publish_time: time,
        };
        let result = self.inner.write_to_known_channel(&record, bytes);
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
        sink.flush().map_err(Error::io(self.path))?;
        Ok(sink)
    }

    fn channel<T: Topic>(&mut self) -> Result<ChannelId, Error> {
        if let Some((_, id)) = self.channels.iter().find(|(name, _)| *name == T::NAME) {
            return Ok(*id);
        }
        let id = self.declare(&Channel::from_topic::<T>())?;
        self.channels.push((T::NAME, id));
        Ok(id)
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
