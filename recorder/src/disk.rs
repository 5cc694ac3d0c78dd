//! The sink that is a folder on a disk.

use crate::Sink;
use randt_log::is_date;
use rustix::fs::{CWD, RenameFlags, renameat_with, statvfs};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// How names of logs end, finished and not.
const ENDING: &str = "mcap";
const ACTIVE: &str = ".active";

/// A folder of logs. It is made where it is missing, again and again.
#[derive(Debug)]
pub struct Disk {
    folder: PathBuf,
    file: Option<OpenFile>,
}

#[derive(Debug)]
struct OpenFile {
    file: File,
    active: PathBuf,
    path: PathBuf,
    /// Its name outlives a power cut.
    is_named: bool,
}

impl Disk {
    /// A folder, which need not be there yet.
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            file: None,
        }
    }

    fn open_file(&mut self) -> io::Result<&mut OpenFile> {
        self.file.as_mut().ok_or(io::ErrorKind::NotFound.into())
    }

    /// New names outlive a power cut only with their folder.
    fn sync_folder(&self) -> io::Result<()> {
        File::open(&self.folder)?.sync_all()
    }
}

impl OpenFile {
    /// Whether it is still found under its name: writing to a deleted file fails nowhere.
    fn is_there(&self) -> io::Result<()> {
        let (ours, found) = (self.file.metadata()?, fs::metadata(&self.active)?);
        if (ours.dev(), ours.ino()) == (found.dev(), found.ino()) {
            return Ok(());
        }
        let text = format!("{}: is another file now", self.active.display());
        Err(io::Error::new(io::ErrorKind::NotFound, text))
    }
}

impl Sink for Disk {
    fn create(&mut self, name: &str) -> io::Result<()> {
        fs::create_dir_all(&self.folder)?;
        let path = self.folder.join(name);
        if path.exists() {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let mut active = OsString::from(&path);
        active.push(ACTIVE);
        let active = PathBuf::from(active);
        let file = File::options().write(true).create_new(true).open(&active)?;
        // The folder is synced with the first bytes, not before them: on a slow disk that would be
        // a long time in which a kill leaves an empty file.
        let is_named = false;
        self.file = Some(OpenFile {
            file,
            active,
            path,
            is_named,
        });
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.open_file()?.file.write_all(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        let open = self.open_file()?;
        open.file.sync_data()?;
        open.is_there()?;
        if !open.is_named {
            self.sync_folder()?;
            self.open_file()?.is_named = true;
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<()> {
        let open = self.open_file()?;
        open.file.sync_all()?;
        open.is_there()?;
        renameat_with(CWD, &open.active, CWD, &open.path, RenameFlags::NOREPLACE)?;
        self.file = None;
        self.sync_folder()
    }

    fn abandon(&mut self) {
        self.file = None;
    }

    fn discard(&mut self) {
        if let Some(open) = self.file.take() {
            // Best effort: the disk is failing.
            let _ = fs::remove_file(&open.active);
        }
    }

    fn free_bytes(&mut self) -> io::Result<u64> {
        fs::create_dir_all(&self.folder)?;
        let room = statvfs(&self.folder)?;
        Ok(room.f_bavail.saturating_mul(room.f_frsize))
    }

    fn delete_oldest(&mut self) -> io::Result<Option<String>> {
        // Only what a recorder has named: others may lie beside it.
        let ours = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            is_date(&name) && path.extension().is_some_and(|ending| ending == ENDING)
        };
        let found = fs::read_dir(&self.folder)?.flatten();
        // Names are dates.
        let oldest = found.map(|entry| entry.path()).filter(ours).min();
        oldest.as_ref().map(fs::remove_file).transpose()?;
        Ok(oldest.map(|path| path.display().to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_gets_its_name_when_it_is_finished_and_overwrites_none() {
        let folder = tempfile::tempdir().unwrap();
        let logs = folder.path().join("a/b");
        let mut disk = Disk::new(&logs);
        disk.create("1.mcap").unwrap();
        disk.append(b"abc").unwrap();
        disk.sync().unwrap();
        assert!(logs.join("1.mcap.active").is_file() && !logs.join("1.mcap").exists());
        disk.finish().unwrap();
        assert_eq!(fs::read(logs.join("1.mcap")).unwrap(), b"abc");
        let taken = disk.create("1.mcap").unwrap_err();
        assert_eq!(taken.kind(), io::ErrorKind::AlreadyExists);
        assert!(disk.free_bytes().unwrap() > 0);
        assert!(
            disk.delete_oldest().unwrap().is_none(),
            "it is no recorder's"
        );
        for name in ["2026-11-24T13-05-11Z.mcap", "2026-11-24T13-05-10Z.mcap"] {
            disk.create(name).unwrap();
            disk.finish().unwrap();
        }
        disk.create("2026-11-24T13-05-09Z.mcap").unwrap();
        let deleted = disk.delete_oldest().unwrap().unwrap();
        assert!(deleted.ends_with("2026-11-24T13-05-10Z.mcap"), "{deleted}");
        assert!(disk.delete_oldest().unwrap().is_some());
        assert!(
            disk.delete_oldest().unwrap().is_none(),
            "the open one stays"
        );
    }

    #[test]
    fn a_file_whose_folder_was_removed_does_not_pass_for_written() {
        let folder = tempfile::tempdir().unwrap();
        let logs = folder.path().join("logs");
        let mut disk = Disk::new(&logs);
        disk.create("1.mcap").unwrap();
        fs::remove_dir_all(&logs).unwrap();
        disk.append(b"abc").unwrap();
        assert!(disk.sync().is_err() && disk.finish().is_err());
        disk.abandon();
        disk.create("0.mcap").unwrap();
        disk.discard();
        assert_eq!(fs::read_dir(&logs).unwrap().count(), 0);
        disk.create("1.mcap").unwrap();
        disk.finish().unwrap();
        assert!(logs.join("1.mcap").is_file());
    }
}
