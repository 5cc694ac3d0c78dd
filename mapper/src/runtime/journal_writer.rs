//! The journal as the process writes it: what a full disk does not take waits in memory.

use randt_mapper::Mapper;
use randt_mapper::journal::{Error, JournalFile};
use randt_messages::{Keyframe, Message, MessageRef};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Keyframes are brought onto the disk this often: what a power cut costs.
const SYNC_EVERY: Duration = Duration::from_millis(500);

/// The journal, and what is wrong with it.
pub struct JournalWriter {
    pub journal: JournalFile,
    /// Keyframes that the journal could not take yet.
    unwritten: VecDeque<Message<Keyframe>>,
    synced: Instant,
    /// What is wrong with the journal; empty where nothing is.
    pub trouble: String,
    /// Whether only opening the journal anew shows what is in it: a matter for the next process.
    pub is_unsure: bool,
}

impl From<JournalFile> for JournalWriter {
    fn from(journal: JournalFile) -> Self {
        Self {
            journal,
            unwritten: VecDeque::new(),
            synced: Instant::now(),
            trouble: String::new(),
            is_unsure: false,
        }
    }
}

impl JournalWriter {
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

    /// Brings the journal onto the disk where it is time, up to `next`; gives whether it did.
    pub fn sync(&mut self, next: u64) -> bool {
        let is_due = self.synced.elapsed() >= SYNC_EVERY && self.journal.on_disk() != next;
        if is_due {
            self.sync_now();
        }
        is_due
    }

    /// Brings all onto the disk.
    pub fn sync_now(&mut self) {
        self.synced = Instant::now();
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
