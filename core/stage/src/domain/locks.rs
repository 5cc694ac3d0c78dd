//! The locks of a domain: which processes are in, which one may wipe it, starts, or watches.

use crate::{Domain, Error};
use std::fs::{self, File, TryLockError};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Programs that may watch a pipeline at once.
const WATCHERS: usize = 8;
/// A start takes a few hundredths of a second.
const START_WAIT: Duration = Duration::from_secs(2);
const START_PAUSE: Duration = Duration::from_millis(3);

/// While a process holds it, no other one wipes the domain.
#[derive(Debug)]
pub struct Presence {
    // The lock goes with the file.
    alive: File,
    path: PathBuf,
}

impl Presence {
    /// Whether other processes still find the file that this one has locked.
    pub(crate) fn is_in_place(&self) -> bool {
        let found = fs::metadata(&self.path).and_then(|found| Ok((found, self.alive.metadata()?)));
        found.is_ok_and(|(found, own)| (found.dev(), found.ino()) == (own.dev(), own.ino()))
    }
}

impl Domain {
    /// Enters the domain: from now on no process wipes it. The first one in clears away what
    /// earlier stages left behind.
    pub fn enter(&self) -> Result<Presence, Error> {
        self.make()?;
        let _entry = self.lock("entry", true)?;
        if let Some(alone) = self.try_alone()? {
            crate::dead_node_cleanup::remove_all(self)?;
            drop(alone);
        }
        self.presence()
    }

    /// Enters only where a stage is in: a process that watches makes no domain, and clears none
    /// away.
    pub(crate) fn visit(&self) -> Result<Option<Presence>, Error> {
        if !self.folder().is_dir() {
            return Ok(None);
        }
        self.check_owner()?;
        let _entry = self.lock("entry", true)?;
        Ok(match self.try_alone()? {
            Some(_alone) => None,
            None => Some(self.presence()?),
        })
    }

    /// Call it while holding the lock `entry`.
    fn presence(&self) -> Result<Presence, Error> {
        Ok(Presence {
            alive: self.lock("alive", false)?,
            path: self.folder().join("alive.lock"),
        })
    }

    /// One of the few locks for processes that only watch: a topic has room for a limited number
    /// of readers, and a stage that comes back must always find room.
    pub(crate) fn watcher_lock(&self) -> Result<File, Error> {
        for watcher in 0..WATCHERS {
            let file = open_private(&self.folder().join(format!("watch-{watcher}.lock")))?;
            if file.try_lock().is_ok() {
                return Ok(file);
            }
        }
        Err(Error::TooManyWatch {
            run: self.folder(),
            most: WATCHERS,
        })
    }

    /// The lock of those who start: one at a time. The wait for it is bounded; a holder that was
    /// stopped (SIGSTOP) does not keep the others from starting.
    pub(crate) fn start(&self) -> Result<File, Error> {
        let path = self.folder().join("start.lock");
        let file = open_private(&path)?;
        let give_up = Instant::now() + START_WAIT;
        let waits = || Instant::now() < give_up && !is_holder_stopped(&path);
        if try_lock(&file, &path, START_PAUSE, waits)? {
            let text = format!("{:<10}", std::process::id());
            let written = file.write_all_at(text.as_bytes(), 0);
            written.map_err(Error::file(path, "cannot be written"))?;
        }
        Ok(file)
    }

    /// The lock that says that no process is in, if that is so. Hold the lock `entry` meanwhile,
    /// or another one may enter.
    pub(crate) fn try_alone(&self) -> Result<Option<File>, Error> {
        let path = self.folder().join("alive.lock");
        let file = open_private(&path)?;
        let is_alone = try_lock(&file, &path, Duration::ZERO, || false)?;
        Ok(is_alone.then_some(file))
    }

    /// Waits for a lock of this domain.
    pub(crate) fn lock(&self, name: &str, exclusive: bool) -> Result<File, Error> {
        let path = self.folder().join(format!("{name}.lock"));
        let file = open_private(&path)?;
        let locked = match exclusive {
            true => file.lock(),
            false => file.lock_shared(),
        };
        locked.map_err(Error::file(path, "cannot be locked"))?;
        Ok(file)
    }
}

/// Locks a file; while another process has it locked, again after a pause as long as `waits`.
/// Returns whether it is locked now.
pub(super) fn try_lock(
    file: &File,
    path: &Path,
    pause: Duration,
    waits: impl Fn() -> bool,
) -> Result<bool, Error> {
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(true),
            Err(TryLockError::WouldBlock) if waits() => std::thread::sleep(pause),
            Err(TryLockError::WouldBlock) => return Ok(false),
            Err(TryLockError::Error(cause)) => {
                return Err(Error::file(path, "cannot be locked")(cause));
            }
        }
    }
}

/// Opens a file to read and to write, or makes it: no other user's.
pub(crate) fn open_private(path: &Path) -> Result<File, Error> {
    File::options()
        .create(true)
        .mode(0o600)
        .truncate(false)
        .read(true)
        .write(true)
        .open(path)
        .map_err(Error::file(path, "cannot be opened"))
}

/// Whether the process that wrote its ID into a lock is stopped.
fn is_holder_stopped(lock: &Path) -> bool {
    let holder = fs::read_to_string(lock).unwrap_or_default();
    let stat = fs::read_to_string(format!("/proc/{}/stat", holder.trim())).unwrap_or_default();
    // The state follows the name, which stands in brackets and may contain brackets.
    let state = stat
        .rsplit_once(')')
        .and_then(|(_, rest)| rest.trim_start().chars().next());
    state == Some('T')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_first_one_in_is_alone() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("alone", Some(run.path())).unwrap();
        let presence = domain.enter().unwrap();
        assert!(domain.try_alone().unwrap().is_none());
        let second = domain.visit().unwrap().unwrap();
        drop(presence);
        assert!(domain.try_alone().unwrap().is_none());
        drop(second);
        assert!(domain.try_alone().unwrap().is_some());
        assert!(domain.visit().unwrap().is_none(), "nothing to watch");
    }

    #[test]
    fn one_that_is_stopped_while_it_starts_keeps_nobody_waiting() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("stopped", Some(run.path())).unwrap();
        domain.make().unwrap();
        let held = domain.start().unwrap();
        let mut stopped = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        held.write_all_at(format!("{:<10}", stopped.id()).as_bytes(), 0)
            .unwrap();
        let pid = rustix::process::Pid::from_child(&stopped);
        rustix::process::kill_process(pid, rustix::process::Signal::STOP).unwrap();
        let begin = Instant::now();
        domain.start().unwrap();
        assert!(begin.elapsed() < START_WAIT / 2);
        stopped.kill().unwrap();
        stopped.wait().unwrap();
    }
}
