//! The map's journal, held open while the drive runs: it is there also where somebody removes its
//! folder meanwhile.

use crate::earlier::JOURNAL;
use crate::output::warn;
use anyhow::Context;
use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom};
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
        if !self.file.metadata().is_ok_and(|found| found.nlink() == 0) {
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
}

#[cfg(test)]
mod tests {
    use super::*;
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
