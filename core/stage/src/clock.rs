//! The one clock that all stages share.

use crate::{Error, Realm};
use rustix::time::{ClockId, clock_gettime};
use std::fs;
use std::io::Write;
use std::path::Path;

/// Time since the boot plus an anchor: reads like the date, never steps, and is the same in every stage, restarted ones
/// too. The anchor is taken once per boot and kept in the run folder, which does not survive one.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    anchor_ns: i64,
}

impl Clock {
    /// The clock of a realm; the first one to ask takes the anchor.
    pub fn of(realm: &Realm) -> Result<Self, Error> {
        let path = realm.run().join("clock-anchor");
        if let Some(anchor_ns) = read(&path) {
            return Ok(Self { anchor_ns });
        }
        let anchor_ns = nanoseconds(ClockId::Realtime) - nanoseconds(ClockId::Boottime);
        // Written whole under a name of our own, then linked: only the first one's link succeeds.
        let own = realm
            .run()
            .join(format!("clock-anchor.{}", std::process::id()));
        let written = fs::File::create(&own).and_then(|mut file| write!(file, "{anchor_ns}"));
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

    /// A clock of one's own, for who looks at devices without a pipeline.
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
    fs::read_to_string(path).ok()?.trim().parse().ok()
}

fn nanoseconds(clock: ClockId) -> i64 {
    let time = clock_gettime(clock);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_stages_share_one_clock_that_reads_like_the_date() {
        let run = tempfile::tempdir().unwrap();
        let realm = Realm::new("clock", Some(run.path())).unwrap();
        let first = Clock::of(&realm).unwrap();
        let second = Clock::of(&realm).unwrap();
        assert_eq!(first.anchor_ns, second.anchor_ns);
        let off_ns = first.now_ns() - nanoseconds(ClockId::Realtime);
        assert!(off_ns.abs() < 1_000_000_000);
        assert!(first.now_ns() <= second.now_ns());
    }
}
