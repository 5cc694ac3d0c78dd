//! What is known of the time: the date, as far as it can be believed, and the time since the boot,
//! which cannot lie.

use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// systemd-timesyncd makes this file when it has set the clock.
const SYNCHRONIZED: &str = "/run/systemd/timesync/synchronized";
/// Clocks that a battery keeps running.
const BATTERY_CLOCKS: &str = "/sys/class/rtc";
/// The system's clock was set by the battery's where they differ by no more than this, s: clocks
/// drift apart by less in months, and one that was set by a file's date is off by the time that
/// the power was off.
const SAME_CLOCK_S: i64 = 60;

/// An instant of a boot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BootTime {
    /// The kernel's name for this boot.
    pub boot_id: String,
    /// Time since it, ns; steps of the clock do not change it.
    pub since_boot_ns: i64,
}

/// Now.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Now {
    /// What the system's clock reads, ns since 1970.
    pub date_ns: i64,
    /// Whether something stands behind it: a clock with a battery, or the network. Without, a
    /// machine that was switched off goes on at the date at which it ended, or in 1970.
    pub is_date_known: bool,
    /// By the clock that runs from the boot on.
    pub boot: BootTime,
}

impl Now {
    /// As this machine has it.
    pub fn read() -> Self {
        let date_ns = nanoseconds(ClockId::Realtime);
        let boot_id = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Self {
            date_ns,
            is_date_known: Path::new(SYNCHRONIZED).exists() || has_battery_clock(date_ns),
            boot: BootTime {
                boot_id: boot_id.trim().to_owned(),
                since_boot_ns: nanoseconds(ClockId::Boottime),
            },
        }
    }

    /// Time since an instant of this boot, ns; `None` for another boot's.
    pub fn since_ns(&self, then: &BootTime) -> Option<i64> {
        let is_same = !then.boot_id.is_empty() && then.boot_id == self.boot.boot_id;
        is_same.then(|| self.boot.since_boot_ns - then.since_boot_ns)
    }
}

/// Whether a clock with a battery agrees with the system's.
fn has_battery_clock(date_ns: i64) -> bool {
    let clocks = fs::read_dir(BATTERY_CLOCKS).into_iter().flatten().flatten();
    let read = |folder: fs::DirEntry| -> Option<i64> {
        let text = fs::read_to_string(folder.path().join("since_epoch")).ok()?;
        text.trim().parse().ok()
    };
    let mut dates_s = clocks.filter_map(read);
    dates_s.any(|date_s| (date_s - date_ns / 1_000_000_000).abs() <= SAME_CLOCK_S)
}

/// A clock's time, ns.
pub fn nanoseconds(clock: ClockId) -> i64 {
    let time = clock_gettime(clock);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}
