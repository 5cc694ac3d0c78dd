//! Domain: what the stages of one pipeline share, and no other pipeline sees.

mod clock;
mod locks;
mod membership;
mod private_folder;
mod registry;
mod rights;

pub use clock::Clock;
pub use locks::Presence;
pub(crate) use locks::open_private;
pub(crate) use membership::Membership;
pub use registry::{Entry, Registry};
pub(crate) use rights::close_to_others;
pub use rights::{Exposed, exposed};

use crate::Error;
use randt_messages::layout::{FNV_SEED, hash_bytes};
use rustix::fs::{Access, AtFlags, CWD, accessat};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Where the run folder is on a robot: systemd makes it.
const SYSTEM_RUN: &str = "/run/randt";
/// Where shared memory lives.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Notices go through sockets in the domain's folder, whose paths the system keeps short.
const SOCKET_PATH_MAX: usize = 107;
/// Most characters of a socket's name after the prefix: iceoryx2's number and ending.
const SOCKET_NAME: usize = 38;

/// A prefix and a run folder. Stages with the same ones find each other; the folder in which a
/// stage was started does not matter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    prefix: String,
    run: PathBuf,
}

impl Domain {
    /// The domain of a prefix. `run`: the run folder, on a file system in memory; if not given,
    /// [`Self::default_run`].
    pub fn new(prefix: &str, run: Option<&Path>) -> Result<Self, Error> {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '-';
        if prefix.is_empty() || prefix.len() > 24 || !prefix.chars().all(good) {
            return Err(Error::BadPrefix(prefix.to_owned()));
        }
        let run = match run {
            // Two stages that name it relative to different folders get the same one.
            Some(run) => std::path::absolute(run).map_err(Error::file(run, "cannot be found"))?,
            None => Self::default_run(user()),
        };
        let domain = Self {
            prefix: prefix.to_owned(),
            run,
        };
        let longest = domain.root().as_os_str().len() + domain.segment_prefix().len() + SOCKET_NAME;
        match longest.checked_sub(SOCKET_PATH_MAX) {
            None | Some(0) => Ok(domain),
            Some(over) => Err(Error::LongPath {
                path: domain.folder(),
                over,
            }),
        }
    }

    /// The run folder of programs without the option: /run/randt if that exists, else the folder
    /// `randt` of the user's session, else /dev/shm/randt-UID.
    pub fn default_run(user: u32) -> PathBuf {
        if Path::new(SYSTEM_RUN).is_dir() {
            return PathBuf::from(SYSTEM_RUN);
        }
        match session_folder(user) {
            Some(session) => session.join("randt"),
            None => Self::shared_run(user),
        }
    }

    /// The run folder of a user who has no session.
    pub fn shared_run(user: u32) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("randt-{user}"))
    }

    /// The prefix.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The run folder, which several prefixes share.
    pub fn run(&self) -> &Path {
        &self.run
    }

    /// This domain's own folder in it.
    pub fn folder(&self) -> PathBuf {
        self.run.join(&self.prefix)
    }

    /// iceoryx2's files, without its shared memory.
    pub fn root(&self) -> PathBuf {
        self.folder().join("bus")
    }

    /// What must survive the death of a stage, but not a reboot.
    pub fn state(&self) -> PathBuf {
        self.folder().join("state")
    }

    /// How files of this domain in /dev/shm begin: the prefix, and a number made of the run
    /// folder, because the same prefix in another run folder is another domain. Short, because
    /// paths of sockets are. No prefix can hold an underscore, so none is another's beginning.
    pub fn segment_prefix(&self) -> String {
        let hash = hash_bytes(FNV_SEED, self.run.as_os_str().as_encoded_bytes());
        format!("{}-{:04x}_", self.prefix, hash as u16)
    }

    /// The files of a folder whose names begin as this domain's do.
    pub(crate) fn files_in(&self, folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
        let prefix = self.segment_prefix();
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries
            .filter(move |entry| entry.file_name().to_string_lossy().starts_with(&prefix))
            .map(|entry| entry.path())
    }

    /// What follows in such a file's name: what it is of, and its kind.
    pub(crate) fn name_parts<'a>(&self, path: &'a Path) -> Option<(&'a str, &'a str)> {
        let name = path.file_name()?.to_str()?;
        name.strip_prefix(&self.segment_prefix())?.split_once('.')
    }

    /// Makes the folders; refuses those in which another user could change anything.
    pub fn make(&self) -> Result<(), Error> {
        private_folder::check_way_to(&self.run, true)?;
        private_folder::check_trusted(&self.run)?;
        for path in [self.folder(), self.root(), self.state()] {
            if let Err(error) = private_folder::make(&path) {
                // This process cannot make anything in another user's folder.
                self.check_owner()?;
                return Err(error);
            }
            private_folder::take_for_own(&path)?;
        }
        Ok(())
    }

    /// Refuses a domain that another user made, or a run folder in which another user could make
    /// or change one.
    pub fn check_owner(&self) -> Result<(), Error> {
        private_folder::check_way_to(&self.run, false)?;
        let owner = match fs::symlink_metadata(&self.run) {
            Ok(found) => found.uid(),
            Err(error) if private_folder::is_hidden(&error) => return Ok(()),
            Err(cause) => return Err(Error::file(&self.run, "cannot be read")(cause)),
        };
        private_folder::check_trusted(&self.run)?;
        let folder = self.folder();
        if fs::symlink_metadata(&folder).is_ok() {
            private_folder::check_own(&folder)?;
        } else if owner != user() && !is_writable(&self.run) {
            return Err(private_folder::other_user(&self.run, owner));
        }
        Ok(())
    }
}

/// The folder in memory of a user's session: $XDG_RUNTIME_DIR, or what logind makes where that is
/// not set, so that a program that cron or sudo starts finds the same one. A folder that others
/// can use is ignored.
fn session_folder(user: u32) -> Option<PathBuf> {
    let named = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let usual = PathBuf::from(format!("/run/user/{user}"));
    let is_own = |path: &PathBuf| {
        let found = fs::symlink_metadata(path);
        path.is_absolute()
            && found.is_ok_and(|found| {
                found.is_dir() && found.uid() == user && found.mode() & 0o777 == 0o700
            })
    };
    named.into_iter().chain([usual]).find(is_own)
}

/// Whether this user may make something in a folder.
fn is_writable(folder: &Path) -> bool {
    accessat(CWD, folder, Access::WRITE_OK, AtFlags::EACCESS).is_ok()
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
            assert!(Domain::new(bad, None).is_err(), "{bad:?}");
        }
        let domain = Domain::new("test-1", Some(Path::new("/tmp/x"))).unwrap();
        assert_eq!(domain.root(), Path::new("/tmp/x/test-1/bus"));
        let begins = domain.segment_prefix();
        assert!(begins.starts_with("test-1-") && begins.ends_with('_'));
        let elsewhere = Domain::new("test-1", Some(Path::new("/tmp/y"))).unwrap();
        assert_ne!(elsewhere.segment_prefix(), begins);
    }

    #[test]
    fn a_folder_whose_sockets_would_have_no_name_is_refused() {
        let longest = "x".repeat(24);
        assert!(Domain::new(&longest, Some(Path::new(SYSTEM_RUN))).is_ok());
        let folder = format!("/tmp/{}", "y".repeat(60));
        let error = Domain::new("randt", Some(Path::new(&folder))).unwrap_err();
        assert!(
            error.to_string().contains("17 characters too long"),
            "{error}"
        );
    }
}
