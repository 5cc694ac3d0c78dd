//! Keyframes on their way into journal and map: in order, each once, none missing.

use super::checkpoint_store::CheckpointStore;
use super::journal_writer::JournalWriter;
use super::keyframe_sequence::{Admission, KeyframeSequence};
use super::replay_queue::{KeyframeFacts, ReplayQueue};
use randt_config::Config;
use randt_mapper::journal::{Damage, JournalFile};
use randt_mapper::{Mapper, SnapshotRejection};
use randt_messages::{Keyframe, KeyframeHead, MessageRef};
use randt_stage::{FileBytes, Stage};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Journal and map, which have the same keyframes; a map that has come back takes the last of them
/// while it listens.
pub struct KeyframeIngest {
    pub mapper: Mapper,
    pub writer: JournalWriter,
    checkpoints: CheckpointStore,
    pub sequence: KeyframeSequence,
    to_replay: ReplayQueue,
}

impl KeyframeIngest {
    /// Goes on where the journal ends.
    pub fn open(path: &Path, config: &Config, stage: &mut Stage) -> Result<Self, Box<dyn Error>> {
        let begin = Instant::now();
        let opened =
            JournalFile::open_by(path, config, |path| Ok(Arc::new(FileBytes::open(path)?)))?;
        let name = path.display();
        if let Some(Damage { offset, what, .. }) = &opened.cut {
            stage.log_info(&format!("{name}: cut at offset {offset}: {what}"));
        }
        if let Some((path, why)) = &opened.quarantined {
            stage.log_info(&format!("{name}: {why}; quarantined as {}", path.display()));
        }
        let mut journal = opened.journal;
        let checkpoints = CheckpointStore::open(stage)?;
        let recalled = Mapper::recall(config, opened.contents, checkpoints.newest());
        let (mapper, restored) = (recalled.mapper, recalled.restored);
        journal.recalled(&mapper);
        if let Some(why) = restored.rejection {
            stage.log_info(&format!("{name}: {}", in_words(why)));
        }
        stage.log_info(&format!(
            "{name}: {} keyframes, {} of them from a snapshot, in {:.3} s; {} are to be taken anew",
            restored.keyframes,
            restored.from_snapshot,
            begin.elapsed().as_secs_f64(),
            restored.replayed,
        ));
        Ok(Self {
            mapper,
            sequence: KeyframeSequence::after(journal.end()),
            writer: JournalWriter::new(journal)?,
            checkpoints,
            to_replay: recalled.to_replay.into(),
        })
    }

    /// Takes a keyframe where it is the next one. Doubles are dropped; before one that is ahead
    /// the missing are asked for. Gives whether to ask at once.
    pub fn take(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        let head = keyframe.head;
        let newest = self.newest_frame();
        let is_new_frame = newest.is_none_or(|newest| head.odom_frame_id > newest);
        let is_double = || is_double(&self.mapper, &self.to_replay, head);
        match self.sequence.admit(head.id, is_new_frame, is_double) {
            Admission::Dropped => false,
            Admission::Missing => true,
            Admission::Taken => {
                self.writer.push(keyframe);
                if self.is_behind() {
                    self.to_replay.push(keyframe);
                } else {
                    self.mapper.push(keyframe);
                    self.snapshot();
                }
                false
            }
        }
    }

    /// Whether the map has yet to take keyframes.
    pub fn is_behind(&self) -> bool {
        self.to_replay.len() > 0
    }

    /// Whether the map is what was published last: the one that came after was being taken when
    /// the process ended.
    pub fn is_as_published(&self) -> bool {
        self.to_replay.len() <= 1
    }

    /// Lets the map take one of them; gives whether that was the last of many.
    pub fn catch_up(&mut self) -> bool {
        let Some(keyframe) = self.to_replay.pop() else {
            return false;
        };
        self.mapper.push_packed(&keyframe);
        self.snapshot();
        self.to_replay.has_ended()
    }

    /// The same as [`Self::progress`] where the map is late.
    pub fn delay(&self) -> String {
        match self.to_replay.is_late {
            true => self.progress(),
            false => String::new(),
        }
    }

    /// Odometry's frame at the journal's newest keyframe.
    pub fn newest_frame(&self) -> Option<u64> {
        let waiting = self.to_replay.newest().map(|newest| newest.odom_frame_id);
        let mapped = || Some(self.mapper.keyframes().last()?.odom_frame_id);
        waiting.or_else(mapped)
    }

    /// How far the map is, in words.
    pub fn progress(&self) -> String {
        match self.to_replay.len() {
            0 => format!("{} keyframes", self.sequence.next),
            _ => {
                let taken = self.mapper.taken();
                let all = taken + self.to_replay.len();
                format!("takes its keyframes anew, {taken} of {all}")
            }
        }
    }

    /// Odometry numbers another drive: it began without its past, and without having heard of this
    /// map. The journal is quarantined whole, and a new one begins.
    pub fn begin_anew(
        self,
        path: &Path,
        config: &Config,
        stage: &mut Stage,
    ) -> Result<Self, Box<dyn Error>> {
        let quarantined = self.writer.into_journal().quarantine()?;
        // As long as it is open its lock is held.
        drop(self.checkpoints);
        stage.log_info(&format!(
            "{}: odometry has begun another drive; the map so far is quarantined as {}",
            path.display(),
            quarantined.display()
        ));
        Self::open(path, config, stage)
    }

    /// A snapshot of a map that has only what the journal has: in memory, and in the journal where
    /// one is due.
    fn snapshot(&mut self) {
        if !self.writer.is_whole() {
            return;
        }
        if self.writer.journal.is_snapshot_due(&self.mapper) {
            self.writer.append_snapshot(&self.mapper);
        }
        let checkpoint = self.writer.journal.checkpoint(&self.mapper);
        self.checkpoints.store(&checkpoint);
        if !self.is_behind() {
            self.writer.compact(&self.mapper);
        }
    }

    /// Has the journal brought onto the disk where it is time; gives whether more is there.
    pub fn sync(&mut self) -> bool {
        self.writer.sync(self.sequence.next)
    }

    /// Brings all onto the disk, and a snapshot with it: the next start then has nothing to push
    /// anew.
    pub fn finish(&mut self) {
        self.writer.write();
        if self.writer.is_whole() && self.writer.journal.has_news(&self.mapper) {
            self.writer.append_snapshot(&self.mapper);
        }
        self.writer.sync_now();
    }
}

/// Whether map or journal have this very keyframe, as far as is known.
fn is_double(mapper: &Mapper, to_replay: &ReplayQueue, head: &KeyframeHead) -> bool {
    let keyframes = mapper.keyframes();
    let found = keyframes.binary_search_by_key(&head.id, |keyframe| keyframe.keyframe_id);
    let mapped = found.ok().and_then(|at| keyframes.get(at));
    let known = mapped.map(KeyframeFacts::from_keyframe);
    let known = known.or_else(|| to_replay.find(head.id));
    known.is_none_or(|known| known == KeyframeFacts::from_head(head))
}

fn in_words(why: SnapshotRejection) -> &'static str {
    match why {
        SnapshotRejection::Foreign => {
            "its last snapshot is of another configuration, or of a build whose snapshots have another form; its keyframes are taken anew"
        }
        SnapshotRejection::Inconsistent => "its last snapshot does not fit its keyframes",
    }
}

#[cfg(test)]
mod tests;
