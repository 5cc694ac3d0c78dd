//! Bringing a journal onto the disk, which may take as long as the disk likes.

use super::whole_file::sync_folder;
use std::fs::File;
use std::io;
use std::path::PathBuf;

/// A sync that has begun: it may run on another thread while the journal grows.
#[derive(Debug)]
pub struct Sync {
    pub(super) file: File,
    /// The file whose name is new in its folder.
    pub(super) renamed: Option<PathBuf>,
    pub(super) end: u64,
}

/// What became of a sync.
#[derive(Debug)]
pub struct Synced {
    pub(super) done: io::Result<()>,
    pub(super) is_renamed: bool,
    pub(super) end: u64,
}

impl Sync {
    /// Comes back when everything is on the disk that was appended before it began.
    pub fn run(self) -> Synced {
        let is_renamed = self.renamed.is_some();
        let folder = || self.renamed.map_or(Ok(()), |path| sync_folder(&path));
        Synced {
            done: self.file.sync_data().and_then(|()| folder()),
            is_renamed,
            end: self.end,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::JournalFile;
    use super::*;
    use crate::journal::Error;
    use randt_config::Config;

    #[test]
    fn after_a_sync_that_failed_the_journal_is_unsure() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.journal");
        let mut journal = JournalFile::open(&path, &Config::default())
            .unwrap()
            .journal;
        let synced = journal.begin_sync().unwrap().run();
        assert!(journal.finish_sync(synced).is_ok());
        let failed = Synced {
            done: Err(io::ErrorKind::Other.into()),
            ..journal.begin_sync().unwrap().run()
        };
        assert!(journal.finish_sync(failed).is_err());
        assert!(matches!(journal.begin_sync(), Err(Error::Unsure(_))));
    }
}
