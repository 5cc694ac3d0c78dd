//! The radar's own clock.

/// How fast a bad quartz is: 200 ppm, twice the worst that is sold.
const SKEW: f64 = 200e-6;

/// Follows the host's clock, until something goes wrong with it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DeviceTime {
    last_ns: Option<i64>,
    ahead_ns: f64,
    began_ns: i64,
    resets: usize,
}

impl DeviceTime {
    /// The radar's time at a time since 1970; `fast`: its clock is just now too fast; `resets`:
    /// how often it has begun anew at 0.
    pub fn device_ns(&mut self, unix_ns: i64, fast: bool, resets: usize) -> i64 {
        let passed_ns = unix_ns - self.last_ns.replace(unix_ns).unwrap_or(unix_ns);
        if fast {
            self.ahead_ns += SKEW * passed_ns as f64;
        }
        if resets > self.resets {
            self.resets = resets;
            self.began_ns = unix_ns;
            self.ahead_ns = 0.0;
        }
        (unix_ns - self.began_ns).saturating_add(self.ahead_ns as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_fast_for_a_while_and_begins_anew() {
        let mut time = DeviceTime::default();
        assert_eq!(time.device_ns(7_000_000_000, false, 0), 7_000_000_000);
        assert_eq!(time.device_ns(8_000_000_000, true, 0), 8_000_200_000);
        assert_eq!(time.device_ns(9_000_000_000, false, 0), 9_000_200_000);
        assert_eq!(time.device_ns(9_500_000_000, false, 1), 0);
        assert_eq!(time.device_ns(9_600_000_000, false, 1), 100_000_000);
    }
}
