//! The robot's keyframes as they are kept for the base: a journal as the mapper's, without
//! snapshots. What odometry's ring no longer has by the end of a break is here.

use crate::stream::Source;
use anyhow::{Context, Result, bail};
use randt_config::Config;
use randt_mapper::journal::{self, Kind};
use randt_messages::{Keyframe, KeyframeHead, Message, MessageRef};
use randt_stage::FileBytes;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Level of zstd over a packed keyframe.
const LEVEL: i32 = 6;
/// Room for a keyframe that is unpacked.
const PACKED_MAX: usize = 1 << 22;

/// Where a keyframe lies, and what identifies it: two that agree in that are one.
#[derive(Clone, Copy, Debug)]
struct Kept {
    offset: u64,
    length: usize,
    facts: (i64, u64, [u64; 3]),
}

/// The journal.
pub struct Journal {
    path: PathBuf,
    config: Config,
    file: File,
    end: u64,
    keyframes: BTreeMap<u64, Kept>,
    series: i64,
    /// Frame of odometry at its last keyframe.
    odom_frame_id: u64,
    /// What a start or another drive has to say.
    pub news: Vec<String>,
}

impl Journal {
    /// Goes on with a journal, or begins one.
    pub fn open(path: &Path, config: &Config) -> Result<Self> {
        let name = path.display();
        let mut options = File::options();
        options.read(true).append(true).create(true).mode(0o600);
        let file = options.open(path).with_context(|| format!("{name}"))?;
        if file.try_lock().is_err() {
            bail!("{name} is in use by another process");
        }
        let mut journal = Self {
            path: path.to_owned(),
            config: config.clone(),
            file,
            end: 0,
            keyframes: BTreeMap::new(),
            series: 0,
            odom_frame_id: 0,
            news: Vec::new(),
        };
        let bytes = FileBytes::open(path).with_context(|| format!("{name}"))?;
        if let Err(why) = journal.read(bytes.as_ref()) {
            drop(bytes);
            return journal.begin_anew(&why.to_string());
        }
        Ok(journal)
    }

    fn read(&mut self, bytes: &[u8]) -> Result<()> {
        if bytes.is_empty() {
            let mut beginning = Vec::new();
            journal::begin(&self.config, &mut beginning);
            self.file.write_all(&beginning)?;
            self.end = beginning.len() as u64;
            return Ok(());
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
            let what = damage.what;
            self.news.push(format!(
                "{}: cut at {}: {what}",
                self.path.display(),
                self.end
            ));
            self.file.set_len(self.end)?;
        }
        Ok(())
    }

    fn keep(&mut self, head: &KeyframeHead, offset: u64, length: usize) {
        if self.keyframes.is_empty() {
            self.series = head.header.stamp_ns;
        }
        let facts = facts(head);
        self.odom_frame_id = head.odom_frame_id;
        self.keyframes.insert(
            head.id,
            Kept {
                offset,
                length,
                facts,
            },
        );
    }

    /// Quarantines the file under a name that is free, and begins another one.
    fn begin_anew(self, why: &str) -> Result<Self> {
        let quarantined = (1..).map(|n| self.path.with_extension(format!("before-{n}")));
        let quarantined = quarantined.into_iter().find(|path| !path.exists());
        let quarantined = quarantined.context("no name is free")?;
        fs::rename(&self.path, &quarantined)?;
        let mut next = Self::open(&self.path, &self.config)?;
        next.news = self.news;
        next.news.push(format!(
            "{why}; what was before is in {}",
            quarantined.display()
        ));
        Ok(next)
    }

    /// The number after the newest keyframe.
    pub fn next(&self) -> u64 {
        self.keyframes.last_key_value().map_or(0, |(id, _)| id + 1)
    }

    /// Frame of odometry at its last keyframe.
    pub fn odom_frame_id(&self) -> u64 {
        self.odom_frame_id
    }

    /// Takes a keyframe, once. One that has the number of another one is another drive's: a new
    /// journal begins.
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) -> Result<()> {
        let head = keyframe.head;
        if let Some(kept) = self.keyframes.get(&head.id) {
            if kept.facts == facts(head) {
                return Ok(());
            }
            let path = self.path.clone();
            let news = std::mem::take(&mut self.news);
            let quarantined = Self {
                path: path.clone(),
                config: self.config.clone(),
                file: self.file.try_clone()?,
                keyframes: BTreeMap::new(),
                news,
                ..*self
            };
            *self = quarantined.begin_anew("odometry has begun another drive")?;
        }
        let mut record = Vec::new();
        journal::append_keyframe(keyframe, &mut record)?;
        if let Err(cause) = self.file.write_all(&record) {
            // Nothing half: it is asked for again.
            self.file.set_len(self.end)?;
            return Err(cause).with_context(|| format!("{}", self.path.display()));
        }
        self.end += record.len() as u64;
        let length = record.len().saturating_sub(RECORD_HEAD);
        self.keep(head, self.end - length as u64, length);
        Ok(())
    }
}

/// Bytes of a record in front of what it holds.
const RECORD_HEAD: usize = 12;

fn facts(head: &KeyframeHead) -> (i64, u64, [u64; 3]) {
    let pose = head.pose.map(f64::to_bits);
    (head.header.stamp_ns, head.odom_frame_id, pose)
}

impl Source for Journal {
    fn series(&self) -> i64 {
        self.series
    }

    fn first_from(&self, id: u64) -> Option<u64> {
        self.keyframes.range(id..).next().map(|(id, _)| *id)
    }

    fn get(&mut self, id: u64) -> Option<Vec<u8>> {
        let kept = self.keyframes.get(&id)?;
        let mut packed = vec![0; kept.length];
        self.file.read_exact_at(&mut packed, kept.offset).ok()?;
        zstd::bulk::compress(&packed, LEVEL).ok()
    }

    /// They stay: a base that has lost its map gets all of them again.
    fn forget_before(&mut self, _: u64) {}
}

/// A keyframe as [`Journal`] gives it.
pub fn unpack(bytes: &[u8]) -> Option<Message<Keyframe>> {
    let packed = zstd::bulk::decompress(bytes, PACKED_MAX).ok()?;
    let mut keyframe = Message::default();
    journal::read_keyframe(&packed, &mut keyframe).then_some(keyframe)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;
    use randt_messages::KeyframePoint;

    fn keyframe(id: u64, drive: i64) -> Message<Keyframe> {
        let mut keyframe = Message::<Keyframe>::default();
        keyframe.head.id = id;
        keyframe.head.header.stamp_ns = drive + id as i64;
        keyframe.head.pose = [id as f64, 0.1, -0.2];
        keyframe.items = vec![KeyframePoint::default(); 5 + id as usize];
        keyframe
    }

    #[test]
    fn keyframes_come_back_whole_after_a_kill_and_another_drive_begins_another_journal() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("link.journal");
        let config = Config::default();
        let mut journal = Journal::open(&path, &config).unwrap();
        for id in [0, 1, 2, 2, 5, 4] {
            journal.push(keyframe(id, 1000).as_ref()).unwrap();
        }
        assert!(
            Journal::open(&path, &config).is_err(),
            "two never write one"
        );
        drop(journal);
        // A power cut took the last one's end.
        let length = fs::metadata(&path).unwrap().len();
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(length - 1)
            .unwrap();
        let mut journal = Journal::open(&path, &config).unwrap();
        assert_eq!(
            (journal.news.len(), journal.next(), journal.series()),
            (1, 6, 1000)
        );
        assert_eq!((journal.first_from(3), journal.get(4)), (Some(5), None));
        journal.push(keyframe(4, 1000).as_ref()).unwrap();
        for id in [0, 1, 2, 4, 5] {
            let found = unpack(&journal.get(id).unwrap()).unwrap();
            assert_eq!(found, keyframe(id, 1000));
        }
        journal.push(keyframe(1, 77_000).as_ref()).unwrap();
        assert_eq!((journal.series(), journal.next()), (77_001, 2));
        assert!(path.with_extension("before-1").exists());
        assert!(unpack(&[1, 2, 3]).is_none());
    }
}
