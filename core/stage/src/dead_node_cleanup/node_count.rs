//! The count of nodes: the one piece of shared memory of a domain whose name can be guessed.
//!
//! iceoryx2 makes it writable for all users, whatever the umask, and waits for ever for one that
//! is empty. So it is made here, for this user alone, before iceoryx2 looks for it.

use super::service_slots::VERSION;
use crate::domain::{SHARED_MEMORY, user};
use crate::{Domain, Error};
use std::fs::{self, File, Metadata};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The end of its name: the SHA-1 of its type's name, its own, and iceoryx2's version.
const NAME: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
/// Its bytes: iceoryx2's version, the count, and padding to eight bytes.
const BYTES: usize = 16;
const NO_NODES: u64 = 0;
/// Its mode.
const PRIVATE: u32 = 0o600;

/// Where it is.
pub(crate) fn path(domain: &Domain) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{}{NAME}", domain.segment_prefix()))
}

/// Makes it if it does not exist, and anew if it is not as it should be. Call it under the lock of
/// those who start. Refuses another user's that cannot be removed.
pub(crate) fn prepare(domain: &Domain) -> Result<(), Error> {
    let path = path(domain);
    let found = match fs::symlink_metadata(&path) {
        Ok(found) => Some(found),
        Err(cause) if cause.kind() == ErrorKind::NotFound => None,
        Err(cause) => return Err(Error::file(path, "cannot be read")(cause)),
    };
    let bytes = found.as_ref().and_then(|found| whole(&path, found));
    if let Some(found) = &found {
        if bytes.is_some() && found.mode() & 0o777 == PRIVATE {
            return Ok(());
        }
        // No process keeps it open, and one that could open the old one cannot reach the new one.
        fs::remove_file(&path).map_err(|cause| match found.uid() {
            owner if owner != user() => Error::OtherUsersMemory {
                path: path.clone(),
                owner,
                user: user(),
            },
            _ => Error::file(&path, "cannot be removed")(cause),
        })?;
    }
    let bytes = bytes.unwrap_or_else(|| {
        let mut bytes = [0; BYTES];
        let (version, count) = bytes.split_at_mut(size_of::<u64>());
        version.copy_from_slice(&VERSION.to_le_bytes());
        count.copy_from_slice(&NO_NODES.to_le_bytes());
        bytes
    });
    // In one go: iceoryx2 waits for one that is half made.
    let mut file = File::options();
    let file = file.write(true).create_new(true).mode(PRIVATE).open(&path);
    let written = file.and_then(|mut file| file.write_all(&bytes));
    written.map_err(Error::file(path, "cannot be made"))
}

/// Its bytes, if it is this user's and iceoryx2 can open it.
fn whole(path: &Path, found: &Metadata) -> Option<[u8; BYTES]> {
    let is_own = found.is_file() && found.uid() == user() && found.nlink() == 1;
    if !is_own || found.len() < BYTES as u64 {
        return None;
    }
    let mut bytes = [0; BYTES];
    File::open(path).ok()?.read_exact(&mut bytes).ok()?;
    (bytes.get(..size_of::<u64>())? == VERSION.to_le_bytes()).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ports::Bus;
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    use std::fs::Permissions;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn names(domain: &Domain) -> Vec<PathBuf> {
        let all = crate::leftovers(domain).into_iter().map(|file| file.path);
        all.filter(|path| path.to_string_lossy().ends_with("global_mgmt"))
            .collect()
    }

    #[test]
    fn iceoryx2_opens_the_one_that_is_made_here() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("count", Some(run.path())).unwrap();
        domain.make().unwrap();
        let count = |domain: &Domain| fs::read(path(domain)).unwrap()[8];
        prepare(&domain).unwrap();
        assert_eq!(count(&domain), 0);
        drop(Bus::open(&domain, "test").unwrap());
        assert_eq!(names(&domain), [path(&domain)], "no other one");
        assert_eq!(count(&domain), 1);
        let found = fs::metadata(path(&domain)).unwrap();
        assert_eq!((found.mode() & 0o777, found.len()), (PRIVATE, BYTES as u64));

        // What an older build made is replaced, and goes on counting.
        fs::set_permissions(path(&domain), Permissions::from_mode(0o666)).unwrap();
        let open = File::options().write(true).open(path(&domain)).unwrap();
        prepare(&domain).unwrap();
        open.set_len(0).unwrap();
        drop(Bus::open(&domain, "test").unwrap());
        assert_eq!(count(&domain), 2);
        fs::remove_file(path(&domain)).unwrap();
    }

    #[test]
    fn what_is_no_count_is_replaced() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("anew", Some(run.path())).unwrap();
        domain.make().unwrap();
        let path = path(&domain);
        let other = run.path().join("other");
        fs::write(&other, [7; 64]).unwrap();
        let fifo = Mode::from_raw_mode(0o600);
        for what in ["empty", "short", "version", "link", "twice", "pipe"] {
            match what {
                "empty" => fs::write(&path, []).unwrap(),
                "short" => fs::write(&path, VERSION.to_le_bytes()).unwrap(),
                "version" => fs::write(&path, [0; BYTES]).unwrap(),
                "link" => symlink(&other, &path).unwrap(),
                "twice" => {
                    fs::write("/dev/shm/randt-test-twice", [0; 64]).unwrap();
                    fs::hard_link("/dev/shm/randt-test-twice", &path).unwrap();
                    fs::remove_file("/dev/shm/randt-test-twice").unwrap();
                    fs::hard_link(&path, "/dev/shm/randt-test-twice").unwrap();
                }
                _ => mknodat(CWD, &path, FileType::Fifo, fifo, 0).unwrap(),
            }
            prepare(&domain).unwrap();
            drop(Bus::open(&domain, "test").unwrap_or_else(|error| panic!("{what}: {error}")));
            assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, PRIVATE);
            fs::remove_file(&path).unwrap();
        }
        let _ = fs::remove_file("/dev/shm/randt-test-twice");
        assert_eq!(
            fs::read(&other).unwrap(),
            [7; 64],
            "nothing was written through the link"
        );
    }
}
