//! When messages are sent: the log's stamps on the machine's clock.

use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The log's stamps on the machine's clock. Emulators of one log that begin at the same second are
/// on one clock.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    begin_ns: i64,
    begin: Instant,
    unix_ns: i64,
}

impl Pace {
    /// The stamp `begin_ns` is played at `at_unix_s` of the system's clock, which may be in the
    /// past; now, where none is given.
    pub fn new(begin_ns: i64, at_unix_s: Option<f64>) -> Self {
        let (now, unix) = (Instant::now(), SystemTime::now());
        let unix = unix.duration_since(UNIX_EPOCH).unwrap_or_default();
        let at = at_unix_s.map_or(unix, Duration::from_secs_f64);
        let begin = if at >= unix {
            now + (at - unix)
        } else {
            now.checked_sub(unix - at).unwrap_or(now)
        };
        let unix_ns = i64::try_from(at.as_nanos()).unwrap_or(i64::MAX);
        Self {
            begin_ns,
            begin,
            unix_ns,
        }
    }

    /// When a stamp is due.
    pub fn due(&self, stamp_ns: i64) -> Instant {
        let after = stamp_ns.saturating_sub(self.begin_ns).max(0);
        self.begin + Duration::from_nanos(after.unsigned_abs())
    }

    /// A stamp as time since 1970, as a device with a synchronised clock has it, ns.
    pub fn unix_ns(&self, stamp_ns: i64) -> i64 {
        self.unix_ns
            .saturating_add(stamp_ns.saturating_sub(self.begin_ns))
    }
}

/// Sleeps until something is due, and serves meanwhile, at least once each `nap`; `false` where
/// the end was asked for first.
pub(crate) fn wait(
    due: Instant,
    nap: Duration,
    ends: &dyn Fn() -> bool,
    mut serve: impl FnMut(),
) -> bool {
    loop {
        serve();
        if ends() {
            return false;
        }
        let pause = due.saturating_duration_since(Instant::now());
        if pause.is_zero() {
            return true;
        }
        thread::sleep(pause.min(nap));
    }
}
