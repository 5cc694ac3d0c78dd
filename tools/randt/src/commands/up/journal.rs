//! The map's journal, held open while the drive runs: it is there also where somebody removes its
//! folder meanwhile.

use crate::earlier::JOURNAL;
use crate::output::warn;
use anyhow::Context;
use randt_mapper::journal::Kind;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A journal that a mapper writes.
#[derive(Debug)]
pub struct HeldJournal {
    path: PathBuf,
    file: File,
}

impl HeldJournal {
    /// Holds the journal that a running mapper has made.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let file = File::open(path).with_context(|| path.display().to_string())?;
        let path = path.to_owned();
        Ok(Self { path, file })
    }

    /// Writes it again where it was removed. What a mapper that came back has begun in its place
    /// is kept beside it.
    pub fn put_back(mut self) -> anyhow::Result<()> {
        let is_held_only = self.file.metadata().is_ok_and(|found| found.nlink() == 0);
        if !is_held_only || self.is_compacted() {
            return Ok(());
        }
        let path = self.path.display();
        let context = || format!("{path}: was removed and cannot be written again");
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder).with_context(context)?;
        }
        if self.path.exists() {
            let names = (1..).map(|n| format!("{JOURNAL}.quarantined-{n}"));
            let free = names.map(|name| self.path.with_file_name(name));
            let free = { free }.find(|path| !path.exists());
            let free = free.with_context(context)?;
            fs::rename(&self.path, free).with_context(context)?;
        }
        self.file.seek(SeekFrom::Start(0)).with_context(context)?;
        let written = File::create_new(&self.path).and_then(|mut to| {
            io::copy(&mut self.file, &mut to)?;
            to.sync_all()
        });
        written.with_context(context)?;
        warn(&format!(
            "{path}: was removed while the drive ran; it is written again"
        ));
        Ok(())
    }

    /// Whether the journal that is there now begins with the same keyframe: its mapper has written
    /// it anew without what it no longer needs.
    fn is_compacted(&mut self) -> bool {
        let mut held = Vec::new();
        let read = self.file.seek(SeekFrom::Start(0));
        let read = read.and_then(|_| self.file.read_to_end(&mut held));
        let now = read.and_then(|_| fs::read(&self.path));
        now.is_ok_and(|now| {
            first_keyframe(&now).is_some_and(|it| first_keyframe(&held) == Some(it))
        })
    }
}

/// The record of a journal's first keyframe.
fn first_keyframe(journal: &[u8]) -> Option<&[u8]> {
    let (_, records) = randt_mapper::journal::records(journal).ok()?;
    Some(records.of_kind(Kind::Keyframe).next()?.payload)
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_config::Config;
    use randt_mapper::journal;
    use randt_messages::{Keyframe, Message};

    #[test]
    fn a_journal_that_was_compacted_stays_and_another_drives_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        let journal = |id: u64, more: &[u8]| {
            let mut bytes = Vec::new();
            journal::begin(&Config::default(), &mut bytes);
            let mut keyframe = Message::<Keyframe>::default();
            keyframe.head.id = id;
            journal::append_keyframe(keyframe.as_ref(), &mut bytes).unwrap();
            [&bytes, more].concat()
        };
        let old = journal(1, b"much that is not needed");
        for (new, is_compacted) in [(journal(1, b""), true), (journal(2, b""), false)] {
            fs::write(&path, &old).unwrap();
            let held = HeldJournal::open(&path).unwrap();
            fs::remove_file(&path).unwrap();
            fs::write(&path, &new).unwrap();
            held.put_back().unwrap();
            let left = if is_compacted { &new } else { &old };
            assert!(fs::read(&path).unwrap() == *left, "{is_compacted}");
        }
    }
    use std::io::Write;

    #[test]
    fn a_journal_that_was_removed_is_there_again_with_what_was_written_since() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        fs::create_dir(&out).unwrap();
        let path = out.join(JOURNAL);
        let mut writer = File::create(&path).unwrap();
        writer.write_all(b"one").unwrap();
        let held = HeldJournal::open(&path).unwrap();
        fs::remove_dir_all(&out).unwrap();
        writer.write_all(b" two").unwrap();
        held.put_back().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one two");

        let held = HeldJournal::open(&path).unwrap();
        fs::remove_file(&path).unwrap();
        fs::write(&path, b"another").unwrap();
        held.put_back().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one two");
        let quarantined = out.join("map.journal.quarantined-1");
        assert_eq!(fs::read(quarantined).unwrap(), b"another");

        let held = HeldJournal::open(&path).unwrap();
        held.put_back().unwrap();
        assert_eq!(
            fs::read_dir(&out).unwrap().count(),
            2,
            "nothing was removed"
        );
    }
}
