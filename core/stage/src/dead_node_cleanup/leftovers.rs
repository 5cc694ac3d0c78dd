//! What dead stages leave behind, and how all of it is taken away when none lives.

use crate::domain::{SHARED_MEMORY, user};
use crate::{Domain, Error};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// A file that a dead stage left behind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// Where.
    pub path: PathBuf,
    /// Memory that it takes, bytes.
    pub bytes: u64,
}

/// Everything that iceoryx2 has of a domain: shared memory and files. While no stage lives, all of
/// that is left over.
pub fn leftovers(domain: &Domain) -> Vec<Leftover> {
    let mut found = Vec::new();
    let memory = domain.files_in(Path::new(SHARED_MEMORY));
    memory.for_each(|path| add(path, &mut found));
    add_below(&domain.root(), &mut found);
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

fn add(path: PathBuf, found: &mut Vec<Leftover>) {
    // Blocks, not length: segments are full of holes.
    let bytes = fs::symlink_metadata(&path).map_or(0, |metadata| metadata.blocks() * 512);
    found.push(Leftover { path, bytes });
}

fn add_below(folder: &Path, found: &mut Vec<Leftover>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            add_below(&path, found);
        } else {
            add(path, found);
        }
    }
}

/// Removes all that dead stages left, and with `state` also what new stages would go on from.
/// Returns what was removed, or `None` if a stage or tool lives in the domain.
pub fn wipe(domain: &Domain, state: bool) -> Result<Option<Vec<Leftover>>, Error> {
    domain.make()?;
    let _entry = domain.lock("entry", true)?;
    let Some(_alone) = domain.try_alone()? else {
        return Ok(None);
    };
    let mut removed = leftovers(domain);
    if state {
        add_below(&domain.state(), &mut removed);
        let path = domain.state();
        fs::remove_dir_all(&path).map_err(Error::file(path, "cannot be removed"))?;
        let stages = domain.folder().join("stages");
        // It does not exist if no stage ever ran.
        let _ = fs::remove_dir_all(stages);
    }
    remove_all(domain)?;
    Ok(Some(removed))
}

fn is_other_users(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.uid() != user())
}

/// Removes every file of iceoryx2. Only for a process that holds [`Domain::try_alone`].
pub(crate) fn remove_all(domain: &Domain) -> Result<(), Error> {
    for leftover in leftovers(domain) {
        let path = leftover.path;
        match fs::remove_file(&path) {
            // Any user can make a file of such a name in /dev/shm. What is not this user's is not
            // opened either.
            Err(_) if is_other_users(&path) => {}
            removed => removed.map_err(Error::file(path, "cannot be removed"))?,
        }
    }
    let root = domain.root();
    if root.is_dir() {
        fs::remove_dir_all(&root).map_err(Error::file(&root, "cannot be removed"))?;
    }
    fs::create_dir_all(&root).map_err(Error::file(&root, "cannot be made"))
}
