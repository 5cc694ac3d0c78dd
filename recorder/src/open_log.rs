//! The file that is being written.

use crate::metadata::channel_of;
use crate::recorder::{Metadata, Settings};
use crate::{Positions, Raw, Sink, Viewer};
use randt_log::{ChannelId, LogStream};
use std::io;

/// Messages by topic.
pub(crate) type Counts = Vec<(&'static str, u64)>;

/// A log on its way into a sink.
pub(crate) struct OpenLog {
    pub name: String,
    stream: LogStream,
    channels: Vec<(&'static str, ChannelId)>,
    pub bytes: u64,
    /// When the log, its chunk and its last sync began, ns.
    pub begun_ns: i64,
    pub chunk_ns: i64,
    pub synced_ns: i64,
    /// How far all that was written reaches, and what of it the sink has.
    pub written: Positions,
    pub appended: Positions,
    /// Messages by topic that were written, and of these those that outlive a power cut: they are
    /// lost with the file where it vanishes, the rest is written again into the next one.
    counts: Counts,
    pub synced: Counts,
    /// Topics that are not recorded.
    leave_out: Vec<String>,
}

impl OpenLog {
    /// Begins it with its metadata, on the disk before the first message. `positions`: how far the
    /// files before it reach.
    pub fn begin(
        name: String,
        settings: &Settings,
        metadata: Metadata,
        positions: &Positions,
        now_ns: i64,
        sink: &mut impl Sink,
    ) -> io::Result<Self> {
        let stream = LogStream::new(&name, settings.log.clone()).map_err(io::Error::other)?;
        let mut log = Self {
            name,
            stream,
            channels: Vec::new(),
            bytes: 0,
            begun_ns: now_ns,
            chunk_ns: now_ns,
            synced_ns: now_ns,
            written: positions.clone(),
            appended: positions.clone(),
            counts: Counts::new(),
            synced: Counts::new(),
            leave_out: settings.leave_out.clone(),
        };
        log.write_metadata(metadata)?;
        log.append(sink)?;
        sink.sync()?;
        Ok(log)
    }

    /// All of it is on the disk.
    pub fn synced(&mut self, now_ns: i64) {
        self.synced_ns = now_ns;
        self.synced.clone_from(&self.counts);
    }

    /// Adds a message and its form for viewers; goes to the sink where a chunk is full.
    pub fn write(
        &mut self,
        raw: &Raw,
        viewer: &mut Viewer,
        sink: &mut impl Sink,
    ) -> io::Result<()> {
        if !self.leave_out.iter().any(|topic| topic == raw.topic) {
            self.put(raw)?;
            // A chunk ends in front of the message that it has no more room for.
            self.append(sink)?;
            self.count(raw.topic);
        }
        if let Some(position) = Positions::position_of(raw) {
            self.written.put(position);
        }
        let mut for_viewers = Vec::new();
        viewer.take(raw, &mut for_viewers);
        for_viewers.iter().try_for_each(|raw| self.put(raw))?;
        self.append(sink)
    }

    fn count(&mut self, topic: &'static str) {
        match self.counts.iter_mut().find(|(name, _)| *name == topic) {
            Some((_, count)) => *count += 1,
            None => self.counts.push((topic, 1)),
        }
    }

    fn put(&mut self, raw: &Raw) -> io::Result<()> {
        let channel = self.channel(raw.topic)?;
        let written = self
            .stream
            .writer()
            .write_bytes(channel, raw.label, &raw.bytes);
        written.map_err(io::Error::other)
    }

    fn write_metadata(&mut self, metadata: Metadata) -> io::Result<()> {
        for (record, fields) in metadata {
            let written = self.stream.writer().write_metadata(record, fields);
            written.map_err(io::Error::other)?;
        }
        Ok(())
    }

    /// Ends the chunk and gives it to the sink.
    pub fn end_chunk(&mut self, now_ns: i64, sink: &mut impl Sink) -> io::Result<()> {
        self.chunk_ns = now_ns;
        self.stream.writer().flush().map_err(io::Error::other)?;
        self.append(sink)
    }

    /// Ends the log with what is known only now.
    pub fn finish(mut self, metadata: Metadata, sink: &mut impl Sink) -> io::Result<()> {
        self.write_metadata(metadata)?;
        let last = self.stream.finish().map_err(io::Error::other)?;
        sink.append(&last)?;
        sink.finish()
    }

    fn append(&mut self, sink: &mut impl Sink) -> io::Result<()> {
        let bytes = self.stream.take();
        if bytes.is_empty() {
            return Ok(());
        }
        self.bytes += bytes.len() as u64;
        sink.append(&bytes)?;
        self.appended.clone_from(&self.written);
        Ok(())
    }

    fn channel(&mut self, topic: &'static str) -> io::Result<ChannelId> {
        if let Some((_, id)) = self.channels.iter().find(|(name, _)| *name == topic) {
            return Ok(*id);
        }
        let id = self.stream.writer().declare(&channel_of(topic));
        let id = id.map_err(io::Error::other)?;
        self.channels.push((topic, id));
        Ok(id)
    }
}
