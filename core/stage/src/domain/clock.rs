//! The one clock that all stages share.

use super::Domain;
use crate::Error;
use rustix::fs::{Mode, OFlags, open};
use rustix::time::{ClockId, clock_gettime};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Held while this process takes an anchor.
static TAKING: Mutex<()> = Mutex::new(());
/// More than the longest number.
const TEXT_MAX: u64 = 32;

/// Time since the boot plus an anchor: reads like the date, never steps, and is the same in every
/// stage, restarted ones too. The anchor is taken once per boot and kept in the run folder, which
/// does not survive one.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    anchor_ns: i64,
}

impl Clock {
    /// The clock of a domain; the first process that asks for it takes the anchor.
    pub fn in_domain(domain: &Domain) -> Result<Self, Error> {
        let path = domain.run().join("clock-anchor");
        if let Some(anchor_ns) = read(&path) {
            return Ok(Self { anchor_ns });
        }
        // Threads of one process would take each other's file away.
        let _turn = TAKING.lock().unwrap_or_else(PoisonError::into_inner);
        let anchor_ns = nanoseconds(ClockId::Realtime) - nanoseconds(ClockId::Boottime);
        // Written whole under a name of our own, then linked: only the first process's link
        // succeeds.
        let own = domain
            .run()
            .join(format!("clock-anchor.{}", std::process::id()));
        // A process with this ID that was killed may have left one. The new file is made by this
        // process.
        let _ = fs::remove_file(&own);
        let made = File::options()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&own);
        let written = made.and_then(|mut file| write!(file, "{anchor_ns}"));
        let linked = written.and_then(|()| fs::hard_link(&own, &path));
        // Best effort: what counts is what the link leads to.
        let _ = fs::remove_file(&own);
        match (read(&path), linked) {
            (Some(anchor_ns), _) => Ok(Self { anchor_ns }),
            (None, Err(cause)) => Err(Error::file(path, "cannot be written")(cause)),
            (None, Ok(())) => Ok(Self { anchor_ns }),
        }
    }

    /// What is added to the time since the boot, ns.
    pub fn anchor_ns(&self) -> i64 {
        self.anchor_ns
    }

    /// A clock without a domain, for a process that uses devices without a pipeline.
    pub fn alone() -> Self {
        Self {
            anchor_ns: nanoseconds(ClockId::Realtime) - nanoseconds(ClockId::Boottime),
        }
    }

    /// Now, ns.
    pub fn now_ns(&self) -> i64 {
        nanoseconds(ClockId::Boottime) + self.anchor_ns
    }
}

fn read(path: &Path) -> Option<i64> {
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = File::from(open(path, flags, Mode::empty()).ok()?);
    let mut text = String::new();
    file.take(TEXT_MAX).read_to_string(&mut text).ok()?;
    text.trim().parse().ok()
}

fn nanoseconds(clock: ClockId) -> i64 {
    let time = clock_gettime(clock);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, mknodat};
    use std::os::unix::fs::symlink;

    #[test]
    fn two_stages_share_one_clock_that_reads_like_the_date() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("clock", Some(run.path())).unwrap();
        let first = Clock::in_domain(&domain).unwrap();
        let second = Clock::in_domain(&domain).unwrap();
        assert_eq!(first.anchor_ns, second.anchor_ns);
        let off_ns = first.now_ns() - nanoseconds(ClockId::Realtime);
        assert!(off_ns.abs() < 1_000_000_000);
        assert!(first.now_ns() <= second.now_ns());
    }

    #[test]
    fn threads_of_one_process_take_one_anchor() {
        for _ in 0..100 {
            let run = tempfile::tempdir().unwrap();
            let domain = Domain::new("clock", Some(run.path())).unwrap();
            let anchor = || Clock::in_domain(&domain).unwrap().anchor_ns();
            let all: Vec<i64> = std::thread::scope(|scope| {
                let threads: Vec<_> = (0..8).map(|_| scope.spawn(anchor)).collect();
                threads.into_iter().map(|t| t.join().unwrap()).collect()
            });
            assert!(all.iter().all(|anchor_ns| *anchor_ns == all[0]), "{all:?}");
        }
    }

    #[test]
    fn an_anchor_is_not_made_through_a_link_nor_read_through_one() {
        let run = tempfile::tempdir().unwrap();
        let path = |name: &str| run.path().join(name);
        let domain = Domain::new("clock", Some(run.path())).unwrap();
        fs::write(path("victim"), "7").unwrap();
        let own = path(&format!("clock-anchor.{}", std::process::id()));
        symlink(path("victim"), &own).unwrap();
        let clock = Clock::in_domain(&domain).unwrap();
        assert_eq!(fs::read_to_string(path("victim")).unwrap(), "7");
        assert!(fs::symlink_metadata(&own).is_err(), "it is taken away");
        // Another file of the same name, and a pipe, which would block.
        fs::write(&own, "of a process that was killed").unwrap();
        fs::remove_file(path("clock-anchor")).unwrap();
        assert!(Clock::in_domain(&domain).is_ok());
        fs::remove_file(path("clock-anchor")).unwrap();
        symlink("victim", path("clock-anchor")).unwrap();
        assert!(
            Clock::in_domain(&domain)
                .is_err_and(|error| error.to_string().contains("clock-anchor"))
        );
        fs::remove_file(path("clock-anchor")).unwrap();
        let mode = Mode::from_raw_mode(0o600);
        mknodat(CWD, path("clock-anchor"), FileType::Fifo, mode, 0).unwrap();
        assert!(Clock::in_domain(&domain).is_err());
        assert_ne!(clock.anchor_ns(), 7);
    }
}
