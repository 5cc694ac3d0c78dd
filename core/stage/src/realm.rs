//! Realm: the world that the stages of one pipeline share, and that no other pipeline sees.

use crate::Error;
use randt_messages::layout::{FNV_SEED, hash_bytes};
use rustix::fs::Access;
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Where the run folder is on a robot: systemd makes it.
const SYSTEM_RUN: &str = "/run/randt";
/// Where shared memory lives.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Notices go through sockets in the realm's folder, whose paths the system keeps short.
const SOCKET_PATH_MAX: usize = 107;
/// Most characters of a socket's name after the prefix: iceoryx2's number and ending.
const SOCKET_NAME: usize = 38;

/// A prefix and a run folder. Stages with the same ones find each other; nothing else decides that, above all not the
/// folder in which a stage was started.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Realm {
    prefix: String,
    run: PathBuf,
}

impl Realm {
    /// The realm of a prefix. `run`: the run folder, on a file system in memory; if not given, /run/randt where that is,
    /// else /dev/shm/randt-UID.
    pub fn new(prefix: &str, run: Option<&Path>) -> Result<Self, Error> {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if prefix.is_empty() || prefix.len() > 24 || !prefix.chars().all(good) {
            return Err(Error::BadPrefix {
                name: prefix.to_owned(),
            });
        }
        let run = match run {
            // Two stages that name it from different folders mean the same one.
            Some(run) => std::path::absolute(run).map_err(Error::file(run, "cannot be found"))?,
            None if Path::new(SYSTEM_RUN).is_dir() => PathBuf::from(SYSTEM_RUN),
            None => Path::new(SHARED_MEMORY).join(format!("randt-{}", user())),
        };
        let realm = Self {
            prefix: prefix.to_owned(),
            run,
        };
        let longest = realm.root().as_os_str().len() + realm.segment_prefix().len() + SOCKET_NAME;
        match longest.checked_sub(SOCKET_PATH_MAX) {
            None | Some(0) => Ok(realm),
            Some(over) => Err(Error::LongPath {
                path: realm.folder(),
                over,
            }),
        }
    }

    /// The prefix.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The run folder, which several prefixes share.
    pub fn run(&self) -> &Path {
        &self.run
    }

    /// This realm's own folder in it.
    pub fn folder(&self) -> PathBuf {
        self.run.join(&self.prefix)
    }

    /// iceoryx2's files that are no shared memory.
    pub fn root(&self) -> PathBuf {
        self.folder().join("bus")
    }

    /// What must survive the death of a stage, but not the machine's.
    pub fn state(&self) -> PathBuf {
        self.folder().join("state")
    }

    /// How files of this realm in /dev/shm begin: the prefix, and a number made of the run folder, because the same prefix
    /// in another run folder is another realm. Short, because paths of sockets are. No prefix can hold an underscore, so
    /// none is another's beginning.
    pub fn segment_prefix(&self) -> String {
        let hash = hash_bytes(FNV_SEED, self.run.as_os_str().as_encoded_bytes());
        format!("{}-{:04x}_", self.prefix, hash as u16)
    }

    /// Makes the folders; refuses those of another user.
    pub fn make(&self) -> Result<(), Error> {
        for path in [self.run.clone(), self.folder(), self.root(), self.state()] {
            let made = fs::DirBuilder::new()
                .recursive(true)
                .mode(0o700)
                .create(&path);
            if let Err(cause) = made {
                // In another user's folder nothing can be made, nor can what is there be seen.
                self.check_owner()?;
                return Err(Error::file(path, "cannot be made")(cause));
            }
        }
        self.check_owner()
    }

    /// Refuses a realm that another user made, or a run folder in which only another user may make one.
    pub fn check_owner(&self) -> Result<(), Error> {
        for path in [self.folder(), self.run.clone()] {
            let found = match fs::metadata(&path) {
                Ok(found) => found,
                Err(error) if is_hidden(&error) => continue,
                Err(cause) => return Err(Error::file(path, "cannot be read")(cause)),
            };
            // A realm of our own in somebody's folder is ours.
            if found.uid() == user() {
                return Ok(());
            }
            let is_open = path == self.run && rustix::fs::access(&path, Access::WRITE_OK).is_ok();
            if !is_open {
                return Err(Error::OtherUser {
                    path,
                    owner: found.uid(),
                    user: user(),
                });
            }
        }
        Ok(())
    }
}

/// Not there, or not to be seen by this user.
fn is_hidden(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::NotFound | ErrorKind::PermissionDenied
    )
}

/// The user that this process is.
pub(crate) fn user() -> u32 {
    rustix::process::geteuid().as_raw()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefix_is_a_plain_word() {
        for bad in ["", "a_b", "a/b", "..", "a b", &"x".repeat(25)] {
            assert!(Realm::new(bad, None).is_err(), "{bad:?}");
        }
        let realm = Realm::new("test-1", Some(Path::new("/tmp/x"))).unwrap();
        assert_eq!(realm.root(), Path::new("/tmp/x/test-1/bus"));
        let begins = realm.segment_prefix();
        assert!(begins.starts_with("test-1-") && begins.ends_with('_'));
        let elsewhere = Realm::new("test-1", Some(Path::new("/tmp/y"))).unwrap();
        assert_ne!(elsewhere.segment_prefix(), begins);
    }

    #[test]
    fn a_folder_whose_sockets_would_have_no_name_is_refused() {
        let longest = "x".repeat(24);
        assert!(Realm::new(&longest, Some(Path::new(SYSTEM_RUN))).is_ok());
        let folder = format!("/tmp/{}", "y".repeat(60));
        let error = Realm::new("randt", Some(Path::new(&folder))).unwrap_err();
        assert!(
            error.to_string().contains("17 characters too long"),
            "{error}"
        );
    }
}
