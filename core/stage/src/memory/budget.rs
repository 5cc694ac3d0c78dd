//! Memory is counted before it is used: when it is full, a store ends the process without an
//! error.

use crate::{Error, domain::SHARED_MEMORY};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Checks that there is memory for what a stage is about to open.
#[derive(Debug)]
pub(crate) struct MemoryBudget {
    stage: String,
}

impl MemoryBudget {
    pub(crate) fn new(stage: &str) -> Self {
        Self {
            stage: stage.to_owned(),
        }
    }

    /// Refuses if there are fewer bytes of shared memory left. A process that runs has taken what
    /// it needs (`preallocation`), so that no memory is promised twice. Call it under the lock of
    /// those who start.
    pub(crate) fn require(&self, what: &str, bytes: usize) -> Result<(), Error> {
        self.require_free(Path::new(SHARED_MEMORY), bytes as u64, what)
    }

    /// Refuses if there is no room for a file; the blocks that it has already are not counted
    /// again.
    pub(crate) fn require_file(&self, path: &Path, bytes: usize) -> Result<(), Error> {
        let folder = path.parent().unwrap_or(path);
        let there = fs::metadata(path).map_or(0, |found| found.blocks() * 512);
        let missing = (bytes as u64).saturating_sub(there);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.require_free(mount_point(folder), missing, &name)
    }

    fn require_free(&self, file_system: &Path, bytes: u64, what: &str) -> Result<(), Error> {
        let free = free_bytes(file_system);
        if free >= bytes {
            return Ok(());
        }
        Err(Error::TooLittleMemory {
            path: file_system.to_owned(),
            stage: self.stage.clone(),
            free_mb: free as f64 * 1e-6,
            needed_mb: bytes as f64 * 1e-6,
            what: what.to_owned(),
        })
    }
}

/// Free memory, bytes; the largest number if the system does not say.
pub(super) fn free_bytes(path: &Path) -> u64 {
    rustix::fs::statvfs(path).map_or(u64::MAX, |found| {
        found.f_bavail.saturating_mul(found.f_frsize)
    })
}

/// The file system that a folder is in: what can be made larger.
fn mount_point(folder: &Path) -> &Path {
    let above = folder.ancestors();
    let inside = above.take_while(|above| device(above) == device(folder));
    inside.last().unwrap_or(folder)
}

fn device(path: &Path) -> Option<u64> {
    fs::metadata(path).ok().map(|found| found.dev())
}
