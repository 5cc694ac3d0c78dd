//! Who may touch the files of a domain: its user alone.

use super::{Domain, user};
use crate::Error;
use crate::dead_node_cleanup::{is_own_file, leftovers};
use rustix::fs::{Mode, OFlags, fchmod, open};
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Bits by which its group and all others may touch a file.
const OTHERS: u32 = 0o077;

/// A file of a domain that another user may touch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exposed {
    /// Where.
    pub path: PathBuf,
    /// The user that owns it.
    pub owner: u32,
    /// What others may do.
    pub mode: u32,
}

/// Files of a domain that others may read or write, or that are another user's than the domain.
pub fn exposed(domain: &Domain) -> Vec<Exposed> {
    let owner = fs::symlink_metadata(domain.folder()).map_or(user(), |found| found.uid());
    let all = files(domain).into_iter();
    all.filter(|(_, found)| found.uid() != owner || found.mode() & OTHERS != 0)
        .map(|(path, found)| Exposed {
            path,
            owner: found.uid(),
            mode: found.mode() & 0o7777,
        })
        .collect()
}

/// Takes the rights of others away from this user's files. A process that has one open keeps it:
/// stages make theirs for themselves alone.
pub(crate) fn close_to_others(domain: &Domain) -> Result<(), Error> {
    for (path, found) in files(domain) {
        if is_own_file(&found) && found.mode() & OTHERS != 0 {
            close(&path)?;
        }
    }
    Ok(())
}

fn close(path: &Path) -> Result<(), Error> {
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let closed = open(path, flags, Mode::empty()).and_then(|file| {
        let mode = Mode::from_raw_mode(rustix::fs::fstat(&file)?.st_mode);
        fchmod(&file, mode.difference(Mode::RWXG | Mode::RWXO))
    });
    match closed {
        // It has just been removed.
        Err(rustix::io::Errno::NOENT) => Ok(()),
        closed => closed.map_err(|cause| Error::file(path, "its mode cannot be set")(cause.into())),
    }
}

/// Shared memory of a domain, and what lies in its folder: locks, entries of the register,
/// checkpoints. Folders inside are reached by its user alone.
fn files(domain: &Domain) -> Vec<(PathBuf, Metadata)> {
    let memory = leftovers(domain).into_iter().map(|file| file.path);
    let folders = [
        domain.folder(),
        domain.folder().join("stages"),
        domain.state(),
    ];
    let entries = folders.iter().flat_map(fs::read_dir).flatten().flatten();
    let beside = entries.map(|entry| entry.path());
    memory
        .chain(beside)
        .filter_map(|path| Some((fs::symlink_metadata(&path).ok()?, path)))
        .filter(|(found, _)| !found.is_dir())
        .map(|(found, path)| (path, found))
        .collect()
}
