//! Memory is counted before it is used: where it is full, a store is the end of the process, without a word.

use crate::{Error, Realm, Registry, janitor::leftovers, realm::SHARED_MEMORY};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// What a stage has said that it needs.
#[derive(Debug)]
pub(crate) struct Memory {
    stage: String,
    realm: Realm,
    /// Shared memory, by topic.
    needed: Vec<(String, usize)>,
}

impl Memory {
    pub(crate) fn new(stage: &str, realm: &Realm) -> Self {
        Self {
            stage: stage.to_owned(),
            realm: realm.clone(),
            needed: Vec::new(),
        }
    }

    /// Refuses where there is no room for so much more shared memory, beside all that the other stages will use. Call it
    /// under the lock of those who start.
    pub(crate) fn need(
        &mut self,
        what: &str,
        bytes: usize,
        registry: &mut Registry,
    ) -> Result<(), Error> {
        self.needed.push((what.to_owned(), bytes));
        let own: usize = self.needed.iter().map(|(_, bytes)| bytes).sum();
        let free = free(Path::new(SHARED_MEMORY));
        let others = outstanding(&self.realm) - registry.entry().needs_bytes as i64;
        // What is to be registered is counted, what of it is in use already is not.
        let missing = (others + own as i64).max(0) as u64;
        if free >= missing {
            return registry.set_needs(own as u64);
        }
        let (largest, most) = self
            .needed
            .iter()
            .max_by_key(|(_, bytes)| *bytes)
            .map_or(("", 0), |(what, bytes)| (what.as_str(), *bytes));
        Err(self.too_little(Path::new(SHARED_MEMORY), free, missing, largest, most))
    }

    /// Refuses where there is no room for a file; what of it is there already is not counted twice.
    pub(crate) fn need_file(&self, path: &Path, bytes: usize) -> Result<(), Error> {
        let folder = path.parent().unwrap_or(path);
        let there = fs::metadata(path).map_or(0, |found| found.blocks() * 512);
        let file = (bytes as u64).saturating_sub(there);
        let is_shared =
            device(folder).is_some() && device(folder) == device(Path::new(SHARED_MEMORY));
        let segments = if is_shared {
            outstanding(&self.realm).max(0) as u64
        } else {
            0
        };
        let (free, missing) = (free(folder), file + segments);
        if free >= missing {
            return Ok(());
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Err(self.too_little(mount_point(folder), free, missing, &name, bytes))
    }

    fn too_little(
        &self,
        path: &Path,
        free: u64,
        missing: u64,
        largest: &str,
        most: usize,
    ) -> Error {
        Error::TooLittleMemory {
            path: path.to_owned(),
            stage: self.stage.clone(),
            free_mb: free as f64 * 1e-6,
            needed_mb: missing as f64 * 1e-6,
            largest: format!("{:.1} MB for {largest}", most as f64 * 1e-6),
        }
    }
}

/// Shared memory that the living stages of a realm will use and do not use yet; less than none where they use more than
/// they said.
fn outstanding(realm: &Realm) -> i64 {
    let stages = Registry::all(realm).into_iter().filter(|(_, lives)| *lives);
    let needed: u64 = stages.map(|(entry, _)| entry.needs_bytes).sum();
    let used: u64 = leftovers(realm).iter().map(|found| found.bytes).sum();
    needed as i64 - used as i64
}

/// Free memory; without end where the system does not say.
fn free(path: &Path) -> u64 {
    rustix::fs::statvfs(path).map_or(u64::MAX, |found| {
        found.f_bavail.saturating_mul(found.f_frsize)
    })
}

/// The file system that a folder is in: what can be made larger.
fn mount_point(folder: &Path) -> &Path {
    let inside = folder
        .ancestors()
        .take_while(|above| device(above) == device(folder));
    inside.last().unwrap_or(folder)
}

fn device(path: &Path) -> Option<u64> {
    fs::metadata(path).ok().map(|found| found.dev())
}
