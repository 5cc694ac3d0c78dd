//! Keyframes on their way into journal and map: in order, each once, none missing.

use super::behind::{Behind, Facts};
use super::past::Past;
use randt_config::Config;
use randt_mapper::{
    Mapper, PassedOver, Place, Recalled,
    journal::{self, JournalFile},
};
use randt_messages::{Keyframe, KeyframeHead, Message, MessageRef};
use randt_stage::{FileBytes, Stage};
use std::collections::VecDeque;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Keyframes are brought onto the disk about so often: what a power cut costs.
const SYNC_EVERY: Duration = Duration::from_millis(500);
/// So many requests for missing keyframes have later ones for an answer before the map goes on without them.
const REFUSALS_MAX: u32 = 6;

/// Journal and map, which have the same keyframes; a map that has come back takes the last of them while it listens.
pub struct Intake {
    mapper: Mapper,
    journal: JournalFile,
    past: Past,
    behind: Behind,
    /// Whether those are more than were being taken.
    is_late: bool,
    /// The keyframe that is waited for.
    next: u64,
    /// Keyframes that the journal could not take yet.
    unwritten: VecDeque<Message<Keyframe>>,
    synced: Instant,
    /// Whether keyframes shall be sent again, whether that was asked for since the last answer, and how often the answer
    /// was a later keyframe. Silence is no answer: odometry may be away itself.
    is_missing: bool,
    is_asked: bool,
    refusals: u32,
    /// Keyframes that never came.
    pub lost: u64,
    /// What is wrong with the journal; empty where nothing is.
    pub trouble: String,
    /// Whether only opening the journal anew tells what is in it: a matter for the next process.
    pub is_unsure: bool,
    /// Whether odometry numbers the drive that the map is of: it has shown that it knows the map's last keyframe. Before
    /// that a keyframe of the right number may be another drive's.
    is_of_this_drive: bool,
    /// Whether a keyframe came that has the number of one of the map's and is another one, or odometry goes on in the
    /// map's frame without having its last one.
    pub is_other_drive: bool,
}

impl Intake {
    /// Goes on where the journal ends.
    pub fn open(path: &Path, config: &Config, stage: &mut Stage) -> Result<Self, Box<dyn Error>> {
        let begin = Instant::now();
        let opened =
            JournalFile::open_by(path, config, |path| Ok(Arc::new(FileBytes::open(path)?)))?;
        let name = path.display();
        if let Some(cut) = &opened.cut {
            stage.log_info(&format!(
                "{name}: cut at offset {}: {}",
                cut.offset, cut.what
            ));
        }
        if let Some((aside, why)) = &opened.aside {
            stage.log_info(&format!("{name}: {why}; set aside as {}", aside.display()));
        }
        let mut journal = opened.journal;
        let past = Past::open(stage)?;
        let Recalled {
            mapper,
            behind,
            restored,
        } = Mapper::recall(config, opened.contents, past.newest());
        journal.recalled(&mapper);
        if let Some(why) = restored.passed_over {
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
            next: journal.end(),
            mapper,
            past,
            is_late: behind.len() > 1,
            behind: behind.into(),
            unwritten: VecDeque::new(),
            synced: Instant::now(),
            // What came while nobody was here is in odometry's ring.
            is_missing: true,
            is_asked: false,
            refusals: 0,
            lost: 0,
            trouble: String::new(),
            is_unsure: false,
            is_of_this_drive: journal.end() == 0,
            journal,
            is_other_drive: false,
        })
    }

    /// Takes a keyframe where it is the next one. Doubles are dropped; before one that is ahead the missing are asked for.
    /// Gives whether to ask at once.
    pub fn take(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        let id = keyframe.head.id;
        if self.is_other_drive {
            return false;
        }
        if id < self.next {
            let is_double = self.is_double(keyframe.head);
            self.is_other_drive = !is_double;
            self.is_of_this_drive |= is_double && id + 1 == self.next;
            return false;
        }
        // A new frame stands by itself, whoever numbered it.
        let frame = keyframe.head.odom_frame_id;
        let is_new_frame = self.newest_frame().is_none_or(|newest| frame > newest);
        if id > self.next || !(self.is_of_this_drive || is_new_frame) {
            let is_news = !self.is_missing;
            self.refusals += u32::from(std::mem::take(&mut self.is_asked));
            if self.refusals < REFUSALS_MAX {
                self.is_missing = true;
                return is_news;
            }
            if id == self.next {
                // None is missing, and yet odometry does not know the one before.
                self.is_other_drive = true;
                return false;
            }
            // Nobody has them any more: a map with a gap is better than none.
            self.lost += id - self.next;
        }
        (self.next, self.is_missing, self.refusals) = (id + 1, false, 0);
        self.is_of_this_drive = true;
        self.write();
        if !self.unwritten.is_empty() || !self.append(keyframe) {
            let mut copy = Message::default();
            *copy.head = *keyframe.head;
            copy.items.extend_from_slice(keyframe.items);
            self.unwritten.push_back(copy);
        }
        if self.is_behind() {
            self.behind.push(keyframe);
        } else {
            self.mapper.push(keyframe);
            self.snapshot();
        }
        false
    }

    /// Whether the map has yet to take keyframes.
    pub fn is_behind(&self) -> bool {
        self.behind.len() > 0
    }

    /// Whether the map is what was told last: the one that came after was being taken when the process ended.
    pub fn is_as_told(&self) -> bool {
        self.behind.len() <= 1
    }

    /// Lets the map take one of them; gives whether that was the last of many.
    pub fn catch_up(&mut self) -> bool {
        let Some(keyframe) = self.behind.pop() else {
            return false;
        };
        self.mapper.push_packed(&keyframe);
        self.snapshot();
        self.is_late |= !self.is_as_told();
        !self.is_behind() && std::mem::take(&mut self.is_late)
    }

    /// The same as [`Self::progress`] where the map is late.
    pub fn delay(&self) -> String {
        match self.is_late {
            true => self.progress(),
            false => String::new(),
        }
    }

    /// Odometry's frame at the journal's newest keyframe.
    pub fn newest_frame(&self) -> Option<u64> {
        self.newest().map(|newest| newest.odom_frame_id)
    }

    /// How far the map is, in words.
    pub fn progress(&self) -> String {
        match self.behind.len() {
            0 => format!("{} keyframes", self.next),
            _ => {
                let taken = self.mapper.taken();
                let all = taken + self.behind.len();
                format!("takes its keyframes anew, {taken} of {all}")
            }
        }
    }

    /// The newest keyframe of the journal.
    fn newest(&self) -> Option<Facts> {
        let newest = || self.mapper.places().last().map(facts);
        self.behind.newest().or_else(newest)
    }

    /// Whether the journal has this very keyframe, as far as is known.
    fn is_double(&self, head: &KeyframeHead) -> bool {
        let places = self.mapper.places();
        let found = places.binary_search_by_key(&head.id, |place| place.keyframe_id);
        let place = found.ok().and_then(|at| places.get(at)).map(facts);
        let known = place.or_else(|| self.behind.find(head.id));
        known.is_none_or(|known| known == Facts::of(head))
    }

    /// Odometry numbers another drive: it began without its past, and without having heard of this map. The journal is set
    /// aside whole, and a new one begins.
    pub fn begin_anew(
        self,
        path: &Path,
        config: &Config,
        stage: &mut Stage,
    ) -> Result<Self, Box<dyn Error>> {
        let Self { journal, past, .. } = self;
        let aside = journal.set_aside()?;
        // Whoever has it open holds its lock.
        drop(past);
        stage.log_info(&format!(
            "{}: odometry has begun another drive; the map so far is set aside as {}",
            path.display(),
            aside.display()
        ));
        Self::open(path, config, stage)
    }

    /// Appends what the journal lacks. A full disk does not stop the map.
    fn write(&mut self) {
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
        self.note(appended)
    }

    /// A snapshot of a map that has nothing but what the journal has: in memory, and in the journal where one is due.
    fn snapshot(&mut self) {
        if !self.unwritten.is_empty() {
            return;
        }
        if self.journal.is_snapshot_due(&self.mapper) {
            let appended = self.journal.append_snapshot(&self.mapper);
            self.note(appended);
        }
        self.past.keep(&self.journal.checkpoint(&self.mapper));
    }

    /// Remembers what is wrong; gives whether nothing is.
    fn note(&mut self, done: Result<(), journal::Error>) -> bool {
        match done {
            Ok(()) => self.trouble.clear(),
            Err(error) => {
                self.trouble = error.to_string();
                self.is_unsure |= matches!(error, journal::Error::Unsure { .. });
            }
        }
        self.trouble.is_empty()
    }

    /// Brings the journal onto the disk where it is time; gives whether it did.
    pub fn sync(&mut self) -> bool {
        if self.synced.elapsed() < SYNC_EVERY || self.journal.on_disk() == self.next {
            return false;
        }
        self.bring();
        true
    }

    fn bring(&mut self) {
        self.synced = Instant::now();
        self.write();
        let synced = self.journal.sync();
        self.note(synced);
    }

    /// Brings all onto the disk, and a snapshot with it: the next start then has nothing to push anew.
    pub fn finish(&mut self) {
        self.write();
        if self.unwritten.is_empty() && self.journal.has_news(&self.mapper) {
            let appended = self.journal.append_snapshot(&self.mapper);
            self.note(appended);
        }
        self.bring();
    }

    /// Whether keyframes shall be sent again, which whoever asks tells odometry.
    pub fn request(&mut self) -> bool {
        self.is_asked = self.is_missing;
        self.is_missing
    }

    /// The keyframe that is waited for.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Keyframes below this number are on the disk.
    pub fn on_disk(&self) -> u64 {
        self.journal.on_disk()
    }

    /// The map.
    pub fn mapper(&mut self) -> &mut Mapper {
        &mut self.mapper
    }
}

fn facts(place: &Place) -> Facts {
    Facts {
        stamp_ns: place.stamp_ns,
        odom_frame_id: place.odom_frame_id,
        pose: place.odom.to_array(),
    }
}

fn in_words(why: PassedOver) -> &'static str {
    match why {
        PassedOver::Foreign => {
            "its last snapshot is of another configuration, or of a build with other snapshots"
        }
        PassedOver::Unfit => "its last snapshot does not fit its keyframes",
    }
}

#[cfg(test)]
mod tests;
