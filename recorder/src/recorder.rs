//! From messages to files: chunks, syncs, rotation, and what to do when the disk fails.
//!
//! Responsible for losing nothing older than about a second, whatever happens, and for files that
//! are each complete by themselves. Not responsible for the disk ([`Sink`]), nor for messages that
//! wait ([`crate::Queue`]).

use crate::metadata::{VERSIONS_METADATA, fields};
use crate::open_log::{Counts, OpenLog};
use crate::{Gap, Positions, Raw, Sink, Viewer};
use randt_log::{Options, name_of_date};
use randt_messages::{DropCause, LogDrop, LogDropTopic, MessageRef, Topic};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io;

/// After a failure the disk is tried again with this period.
const RETRY_NS: i64 = 1_000_000_000;
/// What was recorded is brought onto the disk with this period: with the pauses before and the
/// disk's own time, nothing older than 1.5 s is ever lost.
pub const SYNC_NS: i64 = 800_000_000;
/// Files that begin in the same second have a number; more than this is an error.
const NAMES_MAX: u32 = 1000;

/// How it records.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Room that is left on the disk.
    pub free_min_bytes: u64,
    /// Whether the oldest log goes where there is less.
    pub delete_oldest: bool,
    /// A file ends at this size ...
    pub file_max_bytes: u64,
    /// ... or age.
    pub file_max_ns: i64,
    /// A chunk ends at this age.
    pub chunk_ns: i64,
    /// Topics that are not recorded; viewers get what is made of them all the same.
    pub leave_out: Vec<String>,
    /// Chunks.
    pub log: Options,
}

/// Records at the beginning of every file: names, and their fields.
pub type Metadata = Vec<(&'static str, BTreeMap<String, String>)>;

/// Asked at each beginning of a file: what is true then.
pub type Preamble = Box<dyn FnMut() -> Metadata + Send>;

/// Why nothing is recorded at the moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outage {
    /// As drops have it.
    pub cause: DropCause,
    /// For people.
    pub text: String,
}

/// Takes messages and writes files.
pub struct Recorder<S> {
    sink: S,
    settings: Settings,
    preamble: Preamble,
    viewer: Viewer,
    file: Option<OpenLog>,
    /// Messages that a power cut would still take away; they are written again where the disk
    /// fails.
    unsynced: Vec<Raw>,
    /// How far the files reach without these.
    positions: Positions,
    /// Messages that went with a file that vanished.
    lost: u64,
    outage: Option<Outage>,
    retry_ns: i64,
    files: u64,
}

impl<S: Sink> Recorder<S> {
    /// Nothing is opened before the first [`Recorder::tick`]. `positions`: how far the files reach
    /// that are there.
    pub fn new(
        sink: S,
        settings: Settings,
        preamble: Preamble,
        viewer: Viewer,
        positions: Positions,
    ) -> Self {
        Self {
            sink,
            settings,
            preamble,
            viewer,
            file: None,
            unsynced: Vec::new(),
            positions,
            lost: 0,
            outage: None,
            retry_ns: i64::MIN,
            files: 0,
        }
    }

    /// Whether a file is open: while none is, messages wait in the queue.
    pub fn is_recording(&self) -> bool {
        self.file.is_some()
    }

    /// Why nothing is recorded at the moment.
    pub fn outage(&self) -> Option<&Outage> {
        self.outage.as_ref()
    }

    /// Name of the file that is being written.
    pub fn file(&self) -> Option<&str> {
        self.file.as_ref().map(|file| file.name.as_str())
    }

    /// How far the files reach: what they hold although this process is killed in this moment.
    pub fn positions(&self) -> &Positions {
        let file = self.file.as_ref();
        file.map_or(&self.positions, |file| &file.appended)
    }

    /// Messages that were recorded and are lost.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Messages that may be in no file.
    pub fn unsaved(&self) -> u64 {
        let ours = |raw: &&Raw| raw.topic != LogDropTopic::NAME;
        self.unsynced.iter().filter(ours).count() as u64
    }

    /// Records a message.
    pub fn push(&mut self, raw: Raw, now_ns: i64) {
        let written = match &mut self.file {
            Some(file) => file.write(&raw, &mut self.viewer, &mut self.sink),
            None => Ok(()),
        };
        self.unsynced.push(raw);
        self.check(written, now_ns);
    }

    /// Records what was not.
    pub fn push_drops(&mut self, drops: &[LogDrop], now_ns: i64) {
        for drop in drops {
            self.push(drop_message(drop), now_ns);
        }
    }

    /// Does what is due: call it a few times a second.
    pub fn tick(&mut self, now_ns: i64) {
        if self.file.is_none() && now_ns >= self.retry_ns {
            self.open(now_ns);
        }
        let Some(file) = &mut self.file else { return };
        let is_old = now_ns - file.begun_ns >= self.settings.file_max_ns;
        let done = if is_old || file.bytes >= self.settings.file_max_bytes {
            self.end_file(now_ns).map(|()| self.open(now_ns))
        } else if now_ns - file.synced_ns >= SYNC_NS {
            self.sync(now_ns)
        } else if now_ns - file.chunk_ns >= self.settings.chunk_ns {
            file.end_chunk(now_ns, &mut self.sink)
        } else {
            Ok(())
        };
        self.check(done, now_ns);
    }

    /// Ends the file.
    pub fn finish(&mut self, now_ns: i64) {
        // Where that fails the last second goes into another one, which must be ended too.
        for _ in 0..2 {
            let done = self.end_file(now_ns);
            self.check(done, now_ns);
        }
    }

    /// Ends the file, where one is open.
    fn end_file(&mut self, now_ns: i64) -> io::Result<()> {
        let Some(file) = self.file.take() else {
            return Ok(());
        };
        let (synced, begun_ns) = (file.synced.clone(), file.begun_ns);
        let positions = file.written.clone();
        // The recorder is the first to run: it knows the other stages only at the end.
        let mut metadata = (self.preamble)();
        metadata.retain(|(name, _)| *name == VERSIONS_METADATA);
        let done = file.finish(metadata, &mut self.sink);
        match &done {
            Ok(()) => {
                self.unsynced.clear();
                self.positions = positions;
            }
            Err(cause) => self.judge_loss(cause, synced, begun_ns, now_ns),
        }
        done
    }

    /// A file that is not found any more is lost with what it alone had. The next one lists that
    /// as a drop.
    fn judge_loss(&mut self, cause: &io::Error, synced: Counts, begin_ns: i64, end_ns: i64) {
        if cause.kind() != io::ErrorKind::NotFound {
            return;
        }
        for (topic, count) in synced {
            self.lost += count;
            let gap = Gap {
                cause: DropCause::Failed,
                count,
                begin_ns,
                end_ns,
            };
            self.unsynced.push(drop_message(&gap.message(topic)));
        }
    }

    fn sync(&mut self, now_ns: i64) -> io::Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        file.end_chunk(now_ns, &mut self.sink)?;
        self.sink.sync()?;
        file.synced(now_ns);
        self.positions.clone_from(&file.appended);
        self.unsynced.clear();
        if !self.has_room()? {
            self.finish(now_ns);
            self.stop_for_room(now_ns);
        }
        Ok(())
    }

    /// Begins a file with the messages that may be in no other.
    fn open(&mut self, now_ns: i64) {
        match self.try_open(now_ns) {
            Ok(true) => self.outage = None,
            Ok(false) => self.stop_for_room(now_ns),
            Err(cause) => self.fail(&cause, now_ns),
        }
    }

    fn try_open(&mut self, now_ns: i64) -> io::Result<bool> {
        if !self.has_room()? {
            return Ok(false);
        }
        let name = self.create(now_ns)?;
        // A disk that fails for hours is not filled with beginnings of files.
        let begun = self.begin(name, now_ns);
        self.file = Some(begun.inspect_err(|_| self.sink.discard())?);
        self.files += 1;
        Ok(true)
    }

    fn begin(&mut self, name: String, now_ns: i64) -> io::Result<OpenLog> {
        let mut metadata = (self.preamble)();
        let (number, begun_ns) = (self.files.to_string(), now_ns.to_string());
        let part = fields([("part", number), ("begun_ns", begun_ns)]);
        metadata.push(("randt/file", part));
        let (viewer, sink) = (&mut self.viewer, &mut self.sink);
        let (settings, positions) = (&self.settings, &self.positions);
        let mut file = OpenLog::begin(name, settings, metadata, positions, now_ns, sink)?;
        viewer.begin();
        for raw in &self.unsynced {
            file.write(raw, viewer, sink)?;
        }
        Ok(file)
    }

    fn create(&mut self, now_ns: i64) -> io::Result<String> {
        let date = name_of_date(now_ns);
        for number in 0..NAMES_MAX {
            let name = match number {
                0 => format!("{date}.mcap"),
                _ => format!("{date}-{number}.mcap"),
            };
            match self.sink.create(&name) {
                Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
                created => return created.map(|()| name),
            }
        }
        Err(io::Error::other(format!("{NAMES_MAX} logs of {date}")))
    }

    /// Whether there is room, after old logs have made some where they may.
    fn has_room(&mut self) -> io::Result<bool> {
        while self.sink.free_bytes()? < self.settings.free_min_bytes {
            if !self.settings.delete_oldest || self.sink.delete_oldest()?.is_none() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn stop_for_room(&mut self, now_ns: i64) {
        let floor_gb = self.settings.free_min_bytes as f64 * 1e-9;
        let why = format!("less than {floor_gb:.1} GB left on the disk");
        self.stop(DropCause::Full, why, now_ns);
    }

    fn stop(&mut self, cause: DropCause, why: impl Display, now_ns: i64) {
        self.retry_ns = now_ns + RETRY_NS;
        let text = format!("not recording: {why}");
        self.outage = Some(Outage { cause, text });
    }

    fn check(&mut self, done: io::Result<()>, now_ns: i64) {
        if let Err(cause) = done {
            self.fail(&cause, now_ns);
            // At once into another file; if that fails too, later.
            self.open(now_ns);
        }
    }

    fn fail(&mut self, cause: &io::Error, now_ns: i64) {
        self.sink.abandon();
        if let Some(file) = self.file.take() {
            self.judge_loss(cause, file.synced, file.begun_ns, now_ns);
        }
        let drops = match cause.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => DropCause::Full,
            _ => DropCause::Failed,
        };
        self.stop(drops, cause, now_ns);
    }
}

fn drop_message(head: &LogDrop) -> Raw {
    Raw::from_message(MessageRef::<LogDropTopic> { head, items: &[] })
}
