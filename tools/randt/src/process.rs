//! The kernel's figures of a process.

use std::fs;
use std::time::Instant;

/// A process at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Whether a signal stopped it (SIGSTOP, a debugger).
    pub stopped: bool,
    /// Memory that is its own or shared and in use, bytes.
    pub rss_bytes: u64,
    /// Time on the processors, ticks of the kernel.
    ticks: u64,
    at: Instant,
}

impl Sample {
    /// Reads a process, where there is one.
    pub fn read(pid: u64) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        Self::parse(&stat, Instant::now())
    }

    fn parse(stat: &str, at: Instant) -> Option<Self> {
        // The name may hold spaces and brackets, but what follows may not.
        let (_, fields) = stat.rsplit_once(')')?;
        let fields: Vec<&str> = fields.split_whitespace().collect();
        // Numbered as in proc(5), where the state is the third.
        let number = |i: usize| fields.get(i - 3)?.parse::<u64>().ok();
        Some(Self {
            stopped: matches!(fields.first(), Some(&("T" | "t"))),
            rss_bytes: number(24)? * rustix::param::page_size() as u64,
            ticks: number(14)? + number(15)?,
            at,
        })
    }

    /// Share of one processor since an earlier sample, %.
    pub fn cpu_percent(&self, earlier: &Self) -> Option<f64> {
        let passed_s = self.at.duration_since(earlier.at).as_secs_f64();
        let ticks = self.ticks.checked_sub(earlier.ticks)?;
        let used_s = ticks as f64 / rustix::param::clock_ticks_per_second() as f64;
        (passed_s > 0.0).then(|| 100.0 * used_s / passed_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const STAT: &str = "17 (a) b) T 1 17 17 0 -1 4194304 100 0 0 0 250 50 0 0 20 0 3 0 1234 99 25 18446744073709551615";

    #[test]
    fn a_name_with_brackets_does_not_shift_the_fields() {
        let at = Instant::now();
        let earlier = Sample::parse(STAT, at).unwrap();
        assert!(earlier.stopped);
        assert_eq!(earlier.rss_bytes, 25 * rustix::param::page_size() as u64);
        let later = STAT.replace(" 250 50 ", " 260 65 ").replace(" T ", " S ");
        let later = Sample::parse(&later, at + Duration::from_secs(1)).unwrap();
        assert!(!later.stopped);
        let ticks = rustix::param::clock_ticks_per_second() as f64;
        let expected = 100.0 * 25.0 / ticks;
        assert!((later.cpu_percent(&earlier).unwrap() - expected).abs() < 1e-9);
        assert!(Sample::parse("17 (cut", at).is_none());
        assert!(Sample::parse("17 (cut) S 1 2", at).is_none());
    }

    #[test]
    fn this_process_is_there() {
        let sample = Sample::read(u64::from(std::process::id())).unwrap();
        assert!(!sample.stopped && sample.rss_bytes > 100_000);
        assert!(Sample::read(u64::MAX).is_none());
    }
}
