//! The journal as the process writes it: what a full disk does not take waits in memory.

use super::disk_thread::{DiskThread, Done, Job};
use randt_mapper::Mapper;
use randt_mapper::journal::{Error, JournalFile};
use randt_messages::{Keyframe, Message, MessageRef};
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

/// Keyframes are brought onto the disk this often: what a power cut costs.
const SYNC_EVERY: Duration = Duration::from_millis(500);

/// Whether the disk is done is asked this often; a sync takes some hundredths of a second.
const POLL: Duration = Duration::from_millis(50);
/// A disk that takes longer is named: what is not on the disk waits in odometry's ring
/// of keyframes.
const STALL: Duration = Duration::from_secs(5);
/// After a compaction that failed, for example on a full disk, that many keyframes come
/// before the next one.
const COMPACTION_PAUSE: u64 = 100;

/// The journal, and what is wrong with it.
pub struct JournalWriter {
    pub journal: JournalFile,
    /// Keyframes that the journal could not take yet.
    unwritten: VecDeque<Message<Keyframe>>,
    disk: DiskThread,
    synced: Instant,
    /// No compaction before there are this many keyframes: the last one has failed.
    compaction_from: u64,
    /// What is wrong with the journal; empty where nothing is.
    pub trouble: String,
    /// Whether only opening the journal anew shows what is in it: a matter for the next process.
    pub is_unsure: bool,
}

impl JournalWriter {
    /// Goes on with a journal.
    pub fn new(journal: JournalFile) -> io::Result<Self> {
        Ok(Self {
            journal,
            unwritten: VecDeque::new(),
            disk: DiskThread::begin()?,
            synced: Instant::now(),
            compaction_from: 0,
            trouble: String::new(),
            is_unsure: false,
        })
    }

    /// The journal, once the disk is done with it.
    pub fn into_journal(mut self) -> JournalFile {
        self.disk.wait();
        self.journal
    }

    /// Appends a keyframe behind those that it could not take yet. A full disk does not stop the
    /// map.
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.write();
        if !self.is_whole() || !self.append(keyframe) {
            let mut copy = Message::default();
            *copy.head = *keyframe.head;
            copy.items.extend_from_slice(keyframe.items);
            self.unwritten.push_back(copy);
        }
    }

    /// Whether the journal has all keyframes.
    pub fn is_whole(&self) -> bool {
        self.unwritten.is_empty()
    }

    /// Appends what the journal lacks.
    pub fn write(&mut self) {
        while let Some(keyframe) = self.unwritten.pop_front() {
            if !self.append(keyframe.as_ref()) {
                self.unwritten.push_front(keyframe);
                return;
            }
        }
    }

    /// Whether the journal took a keyframe.
    fn append(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        let appended = self.journal.append_keyframe(keyframe);
        self.set_trouble(appended)
    }

    /// Appends a snapshot of a map that has only what the journal has.
    pub fn append_snapshot(&mut self, mapper: &Mapper) {
        let appended = self.journal.append_snapshot(mapper);
        self.set_trouble(appended);
    }

    /// Has the journal brought onto the disk where it is time, up to `next`; gives whether more is
    /// there since the last call.
    pub fn sync(&mut self, next: u64) -> bool {
        let done = self.disk.poll();
        let is_done = done.is_some_and(|done| self.finish(done));
        let is_due = self.synced.elapsed() >= SYNC_EVERY && self.journal.on_disk() != next;
        let waited = self.synced.elapsed();
        if self.disk.is_busy() && waited >= STALL {
            self.trouble = format!("the disk has been at work for {} s", waited.as_secs());
        }
        if is_due && !self.disk.is_busy() {
            self.synced = Instant::now();
            self.write();
            match self.journal.begin_sync() {
                Ok(sync) => self.disk.give(Job::Sync(sync)),
                Err(error) => _ = self.set_trouble(Err(error)),
            }
        }
        is_done
    }

    /// How long it can wait to be asked again.
    pub fn pause(&self) -> Duration {
        match self.disk.is_busy() {
            true => POLL,
            false => SYNC_EVERY,
        }
    }

    /// Has the journal written anew where it has much that the map, which has all of it, no longer
    /// needs.
    pub fn compact(&mut self, mapper: &Mapper) {
        let is_due = || self.journal.is_compaction_due(mapper);
        if self.journal.end() < self.compaction_from || self.disk.is_busy() || !is_due() {
            return;
        }
        self.synced = Instant::now();
        match self.journal.begin_compaction(mapper) {
            Ok(compaction) => self.disk.give(Job::Compaction(compaction)),
            Err(error) => _ = self.set_trouble(Err(error)),
        }
    }

    /// Takes over what the disk has done; gives whether nothing is wrong.
    fn finish(&mut self, done: Done) -> bool {
        let done = match done {
            Done::Synced(synced) => self.journal.finish_sync(synced),
            Done::Compacted(compacted) => {
                let done = compacted.and_then(|it| self.journal.finish_compaction(it));
                if done.is_err() {
                    self.compaction_from = self.journal.end() + COMPACTION_PAUSE;
                }
                done
            }
        };
        self.set_trouble(done)
    }

    /// Brings all onto the disk, however long that takes.
    pub fn sync_now(&mut self) {
        if let Some(done) = self.disk.wait() {
            self.finish(done);
        }
        self.write();
        let synced = self.journal.sync();
        self.set_trouble(synced);
    }

    /// Remembers what is wrong; gives whether nothing is.
    fn set_trouble(&mut self, done: Result<(), Error>) -> bool {
        match done {
            Ok(()) => self.trouble.clear(),
            Err(error) => {
                self.trouble = error.to_string();
                self.is_unsure |= matches!(error, Error::Unsure(_));
            }
        }
        self.trouble.is_empty()
    }
}
