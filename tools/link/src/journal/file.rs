//! One file of the journal: its keyframes, where they lie in it, and how more are appended.

use anyhow::{Context, Result, bail};
use randt_config::Config;
use randt_mapper::journal::{self, Kind};
use randt_messages::KeyframeHead;
use randt_stage::FileBytes;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;

/// Bytes of a record in front of what it holds.
const RECORD_HEAD: usize = 12;

/// What identifies a keyframe: two that agree in it are one.
pub type KeyframeFacts = (i64, u64, [u64; 3]);

/// What identifies a keyframe.
pub fn facts(head: &KeyframeHead) -> KeyframeFacts {
    let pose = head.pose.map(f64::to_bits);
    (head.header.stamp_ns, head.odom_frame_id, pose)
}

/// Where a keyframe lies.
#[derive(Clone, Copy, Debug)]
struct Kept {
    offset: u64,
    length: usize,
    facts: KeyframeFacts,
}

/// A file of one drive's keyframes. It is this process's alone as long as it is open.
pub struct JournalFile {
    file: File,
    pub end: u64,
    keyframes: BTreeMap<u64, Kept>,
    /// Stamp of its first keyframe, which is that of the drive in each of the drive's files.
    pub series: i64,
    /// Frame of odometry at its last keyframe.
    pub odom_frame_id: u64,
    /// Where it was cut, and why.
    pub cut: Option<String>,
}

impl JournalFile {
    /// Goes on with a file, or begins one.
    pub fn open(path: &Path, config: &Config) -> Result<Self> {
        let name = path.display();
        let mut options = File::options();
        options.read(true).append(true).create(true).mode(0o600);
        let file = options.open(path).with_context(|| format!("{name}"))?;
        if file.try_lock().is_err() {
            bail!("{name} is in use by another process");
        }
        let mut journal = Self {
            file,
            end: 0,
            keyframes: BTreeMap::new(),
            series: 0,
            odom_frame_id: 0,
            cut: None,
        };
        let bytes = FileBytes::open(path).with_context(|| format!("{name}"))?;
        journal.read(bytes.as_ref(), config)?;
        Ok(journal)
    }

    fn read(&mut self, bytes: &[u8], config: &Config) -> Result<()> {
        if bytes.is_empty() {
            let mut beginning = Vec::new();
            journal::begin(config, &mut beginning);
            return self.append(&beginning);
        }
        let (_, mut records) = journal::records(bytes)?;
        let mut head = KeyframeHead::default();
        while let Some(record) = records.next() {
            if record.kind == Kind::Keyframe && journal::read_head(record.payload, &mut head) {
                let length = record.payload.len();
                let offset = (records.good() - length) as u64;
                self.keep(&head, offset, length);
            }
        }
        self.end = records.good() as u64;
        if let Some(damage) = records.damage() {
            self.cut = Some(format!("cut at {}: {}", self.end, damage.what));
            self.file.set_len(self.end)?;
        }
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> Result<()> {
        if let Err(cause) = self.file.write_all(bytes) {
            // Nothing half: it is asked for again.
            self.file.set_len(self.end)?;
            return Err(cause.into());
        }
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Appends the record of a keyframe.
    pub fn push(&mut self, head: &KeyframeHead, record: &[u8]) -> Result<()> {
        self.append(record)?;
        let length = record.len().saturating_sub(RECORD_HEAD);
        self.keep(head, self.end - length as u64, length);
        Ok(())
    }

    fn keep(&mut self, head: &KeyframeHead, offset: u64, length: usize) {
        if self.keyframes.is_empty() {
            self.series = head.header.stamp_ns;
        }
        self.odom_frame_id = head.odom_frame_id;
        let kept = Kept {
            offset,
            length,
            facts: facts(head),
        };
        self.keyframes.insert(head.id, kept);
    }

    /// The first number from one on that is here.
    pub fn first_from(&self, id: u64) -> Option<u64> {
        self.keyframes.range(id..).next().map(|(id, _)| *id)
    }

    /// The greatest number.
    pub fn last(&self) -> Option<u64> {
        self.keyframes.last_key_value().map(|(id, _)| *id)
    }

    /// What identifies a keyframe, where it is here.
    pub fn facts(&self, id: u64) -> Option<KeyframeFacts> {
        self.keyframes.get(&id).map(|kept| kept.facts)
    }

    /// How many there are from a number on.
    pub fn count_from(&self, id: u64) -> u64 {
        self.keyframes.range(id..).count() as u64
    }

    /// A keyframe, packed.
    pub fn get(&self, id: u64) -> Option<Vec<u8>> {
        let kept = self.keyframes.get(&id)?;
        let mut packed = vec![0; kept.length];
        self.file.read_exact_at(&mut packed, kept.offset).ok()?;
        Some(packed)
    }

    /// The record of its first keyframe, as [`Self::push`] takes it, with the head.
    pub fn first_record(&self) -> Option<(KeyframeHead, Vec<u8>)> {
        let is_first = |kept: &&Kept| kept.facts.0 == self.series;
        let kept = self.keyframes.values().find(is_first)?;
        let mut record = vec![0; RECORD_HEAD + kept.length];
        let begin = kept.offset.checked_sub(RECORD_HEAD as u64)?;
        self.file.read_exact_at(&mut record, begin).ok()?;
        let mut head = KeyframeHead::default();
        let is_read = journal::read_head(record.get(RECORD_HEAD..)?, &mut head);
        is_read.then_some((head, record))
    }
}
