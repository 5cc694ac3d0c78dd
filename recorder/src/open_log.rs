//! The file that is being written.

use crate::{Positions, Raw, Sink, metadata::channel_of, recorder::Metadata, viewer::Viewer};
use randt_log::{ChannelId, LogStream, Options};
use std::io;

/// Messages by topic.
pub(crate) type Counts = Vec<(&'static str, u64)>;

/// When the log, its chunk and its last sync began, ns.
struct Times {
    begun_ns: i64,
    chunk_ns: i64,
    synced_ns: i64,
}

/// A log on its way into a sink.
pub(crate) struct OpenLog {
    name: String,
    stream: LogStream,
    channels: Vec<(&'static str, ChannelId)>,
    bytes: u64,
    times: Times,
    /// What viewers get of a message.
    viewer_messages: Vec<Raw>,
    /// How far all that was written reaches, and what of it the sink has.
    written: Positions,
    appended: Positions,
    /// Messages by topic that were written, and of these those that outlive a power cut.
    counts: Counts,
    synced: Counts,
    /// Topics that are not recorded.
    leave_out: Vec<String>,
}

impl OpenLog {
    /// Begins it with its metadata, on the disk before the first message. `positions`: how far the
    /// files before it reach.
    pub fn begin(
        name: String,
        options: Options,
        leave_out: Vec<String>,
        metadata: Metadata,
        positions: &Positions,
        now_ns: i64,
        sink: &mut impl Sink,
    ) -> io::Result<Self> {
        let mut stream = LogStream::new(&name, options).map_err(io::Error::other)?;
        for (record, fields) in metadata {
            stream
                .writer()
                .write_metadata(record, fields)
                .map_err(io::Error::other)?;
        }
        let mut log = Self {
            name,
            stream,
            channels: Vec::new(),
            bytes: 0,
            times: Times {
                begun_ns: now_ns,
                chunk_ns: now_ns,
                synced_ns: now_ns,
            },
            viewer_messages: Vec::new(),
            leave_out,
            written: positions.clone(),
            appended: positions.clone(),
            counts: Counts::new(),
            synced: Counts::new(),
        };
        log.append(sink)?;
        sink.sync()?;
        Ok(log)
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    pub fn is_older(&self, now_ns: i64, than_ns: i64) -> bool {
        now_ns - self.times.begun_ns >= than_ns
    }

    pub fn is_chunk_due(&self, now_ns: i64, after_ns: i64) -> bool {
        now_ns - self.times.chunk_ns >= after_ns
    }

    pub fn is_sync_due(&self, now_ns: i64, after_ns: i64) -> bool {
        now_ns - self.times.synced_ns >= after_ns
    }

    /// All of it is on the disk.
    pub fn synced(&mut self, now_ns: i64) {
        self.times.synced_ns = now_ns;
        self.synced.clone_from(&self.counts);
    }

    /// How far it reaches in the sink.
    pub fn positions(&self) -> &Positions {
        &self.appended
    }

    /// How far it reaches when all of it is in the sink.
    pub fn written(&self) -> &Positions {
        &self.written
    }

    /// What is lost with the file where it vanishes: the rest is written again into the next one.
    pub fn only_here(&self) -> Counts {
        self.synced.clone()
    }

    /// When it began, ns.
    pub fn begun_ns(&self) -> i64 {
        self.times.begun_ns
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
        viewer.take(raw, &mut self.viewer_messages);
        self.write_viewer_messages()?;
        self.append(sink)
    }

    fn count(&mut self, topic: &'static str) {
        match self.counts.iter_mut().find(|(name, _)| *name == topic) {
            Some((_, count)) => *count += 1,
            None => self.counts.push((topic, 1)),
        }
    }

    fn write_viewer_messages(&mut self) -> io::Result<()> {
        let mut messages = std::mem::take(&mut self.viewer_messages);
        for raw in messages.drain(..) {
            self.put(&raw)?;
        }
        self.viewer_messages = messages;
        Ok(())
    }

    fn put(&mut self, raw: &Raw) -> io::Result<()> {
        let channel = self.channel(raw.topic)?;
        let written = self
            .stream
            .writer()
            .write_bytes(channel, raw.label, &raw.bytes);
        written.map_err(io::Error::other)
    }

    /// Ends the chunk and gives it to the sink.
    pub fn end_chunk(&mut self, now_ns: i64, sink: &mut impl Sink) -> io::Result<()> {
        self.times.chunk_ns = now_ns;
        self.stream.writer().flush().map_err(io::Error::other)?;
        self.append(sink)
    }

    /// Ends the log with what is known only now.
    pub fn finish(mut self, metadata: Metadata, sink: &mut impl Sink) -> io::Result<()> {
        for (record, fields) in metadata {
            let written = self.stream.writer().write_metadata(record, fields);
            written.map_err(io::Error::other)?;
        }
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
