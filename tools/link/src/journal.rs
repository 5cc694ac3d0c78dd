//! The robot's keyframes as they are kept for the base: a journal as the mapper's, without
//! snapshots. What odometry's ring no longer has by the end of a break is here. It lies in several
//! files, of which the oldest goes where there are too many.

mod file;

use crate::stream::Source;
use anyhow::{Context, Result};
use file::{JournalFile, facts};
use randt_config::Config;
use randt_mapper::journal;
use randt_messages::{Keyframe, Message, MessageRef};
use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};

/// Level of zstd over a packed keyframe.
const LEVEL: i32 = 6;
/// Room for a keyframe that is unpacked.
const PACKED_MAX: usize = 1 << 22;
/// Files at most, those of other drives and damaged ones among them: what goes at once is an
/// eighth.
const FILES: usize = 8;

/// The journal.
pub struct Journal {
    path: PathBuf,
    config: Config,
    /// Bytes of one file.
    file_max: u64,
    /// Those of this drive, the one that is written to last.
    files: VecDeque<JournalFile>,
    /// The keyframe that the base wants next.
    wanted: u64,
    /// Keyframes that had to go before the base had them.
    pub lost: u64,
    /// What a start, another drive or a file that is gone has to say.
    pub news: Vec<String>,
}

impl Journal {
    /// Goes on with a journal, or begins one. `bytes_max`: of all files.
    pub fn open(path: &Path, config: &Config, bytes_max: u64) -> Result<Self> {
        let mut journal = Self {
            path: path.to_owned(),
            config: config.clone(),
            file_max: bytes_max / FILES as u64,
            files: VecDeque::new(),
            wanted: 0,
            lost: 0,
            news: Vec::new(),
        };
        let mut file = journal.open_file()?;
        // Those before it, as far back as they are of this drive.
        for number in journal.numbers()?.into_iter().rev() {
            let Ok(before) = JournalFile::open(&journal.before(number), config) else {
                break;
            };
            if file.last().is_none()
                && let Some((head, record)) = before.first_record()
            {
                // A kill was quicker than the first keyframe of the next file.
                file.push(&head, &record)?;
            }
            if before.series != file.series {
                break;
            }
            journal.files.push_front(before);
        }
        journal.files.push_back(file);
        journal.remove_oldest()?;
        Ok(journal)
    }

    /// Opens the file that is written to. One that cannot be read is quarantined.
    fn open_file(&mut self) -> Result<JournalFile> {
        let file = match JournalFile::open(&self.path, &self.config) {
            Err(why) if why.is::<journal::Error>() => {
                self.quarantine(&why.to_string())?;
                JournalFile::open(&self.path, &self.config)?
            }
            opened => opened?,
        };
        let name = self.path.display();
        self.news
            .extend(file.cut.iter().map(|cut| format!("{name}: {cut}")));
        Ok(file)
    }

    fn before(&self, number: u64) -> PathBuf {
        self.path.with_extension(format!("before-{number}"))
    }

    /// Numbers of the files before this one, the oldest first.
    fn numbers(&self) -> Result<Vec<u64>> {
        let folder = self.path.parent().filter(|it| !it.as_os_str().is_empty());
        let entries = fs::read_dir(folder.unwrap_or(Path::new(".")))?;
        let stem = self.path.file_stem().unwrap_or_default();
        let number = |path: PathBuf| {
            let ending = path.extension()?.to_str()?.strip_prefix("before-")?;
            (path.file_stem()? == stem).then_some(ending.parse().ok()?)
        };
        let mut numbers: Vec<u64> = entries
            .filter_map(|entry| number(entry.ok()?.path()))
            .collect();
        numbers.sort_unstable();
        Ok(numbers)
    }

    fn free_number(&self) -> Result<u64> {
        Ok(self.numbers()?.last().map_or(1, |last| last + 1))
    }

    /// Gives the file that is written to a name of its own, and says so.
    fn quarantine(&mut self, why: &str) -> Result<()> {
        let before = self.before(self.free_number()?);
        fs::rename(&self.path, &before).with_context(|| format!("{}", before.display()))?;
        let text = format!("{why}; what was before is in {}", before.display());
        self.news.push(text);
        Ok(())
    }

    /// Removes what is too much.
    fn remove_oldest(&mut self) -> Result<()> {
        let numbers = self.numbers()?;
        let surplus = (numbers.len() + 1).saturating_sub(FILES);
        for (index, number) in numbers.iter().enumerate().take(surplus) {
            let path = self.before(*number);
            fs::remove_file(&path).with_context(|| format!("{}", path.display()))?;
            // Of this drive's are all but the last one among those with a number.
            if numbers.len() - index < self.files.len()
                && let Some(gone) = self.files.pop_front()
            {
                // Its first one is in each file.
                let from = self.wanted.max(gone.first_from(0).unwrap_or(0) + 1);
                self.lost += gone.count_from(from);
            }
            let most = self.file_max * FILES as u64 / 1_000_000;
            let name = path.display();
            self.news.push(format!(
                "{name}: removed, for the journal has more than {most} MB or {FILES} files"
            ));
        }
        Ok(())
    }

    /// The number after the newest keyframe.
    pub fn next(&self) -> u64 {
        let last = self.files.iter().filter_map(JournalFile::last).max();
        last.map_or(0, |id| id + 1)
    }

    /// Frame of odometry at its last keyframe.
    pub fn odom_frame_id(&self) -> u64 {
        self.files.back().map_or(0, |file| file.odom_frame_id)
    }

    /// Takes a keyframe, once. One that has the number of another one is another drive's: a new
    /// journal begins.
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) -> Result<()> {
        let head = keyframe.head;
        let kept = self.files.iter().rev().find_map(|file| file.facts(head.id));
        if kept == Some(facts(head)) {
            return Ok(());
        }
        if kept.is_some() {
            self.quarantine("odometry has begun another drive")?;
            self.files.clear();
            let file = self.open_file()?;
            self.files.push_back(file);
            self.wanted = 0;
            self.remove_oldest()?;
        }
        self.begin_next_file()?;
        let mut record = Vec::new();
        journal::append_keyframe(keyframe, &mut record)?;
        let file = self.files.back_mut().context("no file is open")?;
        let pushed = file.push(head, &record);
        pushed.with_context(|| format!("{}", self.path.display()))
    }

    /// Begins the next file where one is full. It begins with the drive's first keyframe, by which
    /// the base knows the drive.
    fn begin_next_file(&mut self) -> Result<()> {
        let Some(full) = self.files.back().filter(|file| file.end > self.file_max) else {
            return Ok(());
        };
        let (head, record) = full.first_record().context("no first keyframe")?;
        // Where the disk is full, all stays as it is.
        let part = self.path.with_extension("part");
        let _ = fs::remove_file(&part);
        let mut file = JournalFile::open(&part, &self.config)?;
        file.push(&head, &record)?;
        fs::rename(&self.path, self.before(self.free_number()?))?;
        fs::rename(&part, &self.path)?;
        self.files.push_back(file);
        self.remove_oldest()
    }
}

impl Source for Journal {
    fn series(&self) -> i64 {
        self.files.back().map_or(0, |file| file.series)
    }

    fn first_from(&self, id: u64) -> Option<u64> {
        let files = self.files.iter();
        files.filter_map(|file| file.first_from(id)).min()
    }

    fn get(&mut self, id: u64) -> Option<Vec<u8>> {
        let packed = self.files.iter().find_map(|file| file.get(id))?;
        zstd::bulk::compress(&packed, LEVEL).ok()
    }

    /// They stay as long as there is room: a base that has lost its map gets them again.
    fn forget_before(&mut self, id: u64) {
        self.wanted = id;
    }
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
    use std::fs::File;

    const MB: u64 = 1_000_000;

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
        let mut journal = Journal::open(&path, &config, MB).unwrap();
        for id in [0, 1, 2, 2, 5, 4] {
            journal.push(keyframe(id, 1000).as_ref()).unwrap();
        }
        assert!(
            Journal::open(&path, &config, MB).is_err(),
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
        let mut journal = Journal::open(&path, &config, MB).unwrap();
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

    /// Bytes of all files of a journal, and how many there are.
    fn size(folder: &Path) -> (u64, usize) {
        let files = fs::read_dir(folder).unwrap();
        let sizes: Vec<u64> = files
            .map(|file| file.unwrap().metadata().unwrap().len())
            .collect();
        (sizes.iter().sum(), sizes.len())
    }

    #[test]
    fn it_has_a_greatest_size_and_goes_on_over_its_files_without_what_is_oldest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("link.journal");
        let config = Config::default();
        let bytes_max = 200_000;
        let mut journal = Journal::open(&path, &config, bytes_max).unwrap();
        let (mut largest, mut lost) = (0, 0);
        for id in 0..400 {
            journal.push(keyframe(id, 1000).as_ref()).unwrap();
            // The base has all up to here, and none later.
            journal.forget_before(id.min(200));
            let (bytes, files) = size(folder.path());
            assert!(files <= FILES);
            largest = largest.max(bytes);
            lost = lost.max(journal.lost);
            if id % 90 == 89 {
                drop(journal);
                journal = Journal::open(&path, &config, bytes_max).unwrap();
                assert_eq!((journal.series(), journal.next()), (1000, id + 1));
                journal.forget_before(id.min(200));
            }
        }
        // A file ends behind the keyframe that does not fit.
        assert!(
            (bytes_max / 2..bytes_max * 5 / 4).contains(&largest),
            "{largest}"
        );
        // The drive's first one, and from another one on each.
        let first = journal.first_from(1).unwrap();
        assert!(first > 200, "{first}");
        assert!(lost > 0 && lost <= first - 200, "{lost}, {first}");
        for id in [0].into_iter().chain(first..400) {
            assert_eq!(journal.first_from(id), Some(id));
            let found = unpack(&journal.get(id).unwrap()).unwrap();
            assert_eq!(found, keyframe(id, 1000));
        }
        // Other drives' files count too.
        for drive in 2..30 {
            journal
                .push(keyframe(0, drive * 1_000_000).as_ref())
                .unwrap();
            assert!(size(folder.path()).1 <= FILES);
            assert_eq!((journal.series(), journal.next()), (drive * 1_000_000, 1));
        }
    }
}
