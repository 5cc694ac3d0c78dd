//! What is missing between readings, and how often they really come.

use crate::Reading;

/// A longer step than this is a device that was away, ns.
const AWAY_NS: i64 = 10_000_000_000;
/// The interval is checked after this many readings: a quarter of a second.
const CHECKED_AFTER: usize = 64;
/// A change below this share is no change: stamps have a grain, and a text that wavers is of no
/// use.
const SAME: f64 = 0.02;
/// The device may be off its rate by this share: quartzes are not, dividers are.
const TOLERANCE: f64 = 0.1;

/// Counts lost readings by the device's own number, or else by its time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sequence {
    last: Option<Reading>,
    steps_ns: Vec<i64>,
    usual_ns: f64,
    asked_ns: i64,
    lost: u64,
}

impl Sequence {
    /// The device was opened anew: what it counts may have begun anew.
    pub(crate) fn restart(&mut self) {
        self.last = None;
    }

    /// Whether it is the last one once more.
    pub(crate) fn is_double(&self, reading: &Reading) -> bool {
        let counts = reading.device_ns.is_some() || reading.counter.is_some();
        counts
            && self.last.is_some_and(|last| {
                (last.device_ns, last.counter) == (reading.device_ns, reading.counter)
            })
    }

    /// Takes the next reading of a device that agreed to this interval.
    pub(crate) fn push(&mut self, reading: &Reading, interval_ns: i64) {
        if interval_ns != self.asked_ns {
            (self.asked_ns, self.usual_ns) = (interval_ns, interval_ns as f64);
            self.steps_ns.clear();
        }
        let Some(last) = self.last.replace(*reading) else {
            return;
        };
        let step_ns = reading
            .device_ns
            .zip(last.device_ns)
            .map(|(now, then)| now.saturating_sub(then))
            .filter(|step_ns| (1..AWAY_NS).contains(step_ns));
        if let (Some(now), Some(then)) = (reading.counter, last.counter) {
            let step = now.wrapping_sub(then);
            // A step back is a device begun anew.
            if step < u16::MAX / 2 {
                self.lost += u64::from(step.saturating_sub(1));
            }
        } else if let Some(step_ns) = step_ns {
            let steps = step_ns as f64 / self.usual_ns;
            self.lost += ((steps + 0.5) as u64).saturating_sub(1);
        }
        if let Some(step_ns) = step_ns {
            self.steps_ns.push(step_ns);
            if self.steps_ns.len() == CHECKED_AFTER {
                self.check_interval();
            }
        }
    }

    /// The usual interval: the mean of the shorter steps, so that lost readings do not move it.
    fn check_interval(&mut self) {
        self.steps_ns.sort_unstable();
        let short_ns = self.steps_ns.get(CHECKED_AFTER / 4).copied().unwrap_or(1);
        // Stamps with a grain are off by less, and a lost reading by more.
        let near = |step_ns: &&i64| **step_ns < short_ns.saturating_mul(7) / 4;
        let (mut sum_ns, mut count) = (0, 0);
        for step_ns in self.steps_ns.iter().filter(near) {
            (sum_ns, count) = (sum_ns + step_ns, count + 1);
        }
        self.steps_ns.clear();
        if count > 0 {
            let mean_ns = sum_ns as f64 / f64::from(count);
            if (mean_ns / self.usual_ns - 1.0).abs() > SAME {
                self.usual_ns = mean_ns;
            }
        }
    }

    /// Readings that are missing.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }

    /// Readings a second as they come, and as they should, where these differ.
    pub(crate) fn wrong_rate(&self) -> Option<(f64, f64)> {
        let asked_ns = self.asked_ns as f64;
        let wrong = (self.usual_ns / asked_ns - 1.0).abs() > TOLERANCE;
        wrong.then(|| (1e9 / self.usual_ns, 1e9 / asked_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(device_ns: Option<i64>, counter: Option<u16>) -> Reading {
        Reading {
            device_ns,
            counter,
            ..Reading::default()
        }
    }

    #[test]
    fn lost_readings_are_counted_by_number_or_by_time() {
        let mut by_time = Sequence::default();
        let mut by_number = Sequence::default();
        for i in (0..2000_i64).filter(|i| !(500..507).contains(i) && *i != 900) {
            // A millisecond's grain.
            let device_ns = i * 4_000_000 + i % 2 * 1_000_000;
            by_time.push(&at(Some(device_ns), None), 4_000_000);
            by_number.push(&at(None, Some((65_000 + i) as u16)), 4_000_000);
        }
        assert_eq!((by_time.lost(), by_number.lost()), (8, 8));
        assert_eq!(by_time.wrong_rate(), None);
    }

    #[test]
    fn many_lost_readings_are_no_other_rate() {
        let mut sequence = Sequence::default();
        for i in (0..2000).filter(|i| i % 3 != 0) {
            sequence.push(&at(Some(i * 4_000_000), None), 4_000_000);
            assert_eq!(sequence.wrong_rate(), None);
        }
        assert_eq!(sequence.lost(), 666);
    }

    #[test]
    fn a_device_begun_anew_has_lost_nothing() {
        let mut sequence = Sequence::default();
        for i in [100, 101, 0, 1, 2] {
            sequence.push(&at(Some(i64::from(i) * 4_000_000), Some(i)), 4_000_000);
        }
        sequence.restart();
        sequence.push(&at(Some(9_000_000_000), Some(700)), 4_000_000);
        assert_eq!(sequence.lost(), 0);
    }

    #[test]
    fn another_rate_is_noticed() {
        let mut sequence = Sequence::default();
        for i in 0..1000 {
            sequence.push(&at(Some(i * 8_000_000), None), 4_000_000);
        }
        let (is, asked) = sequence.wrong_rate().unwrap();
        assert!((is - 125.0).abs() < 1.0 && asked == 250.0, "{is}");
        // Until it is known to be the rate.
        assert_eq!(sequence.lost(), CHECKED_AFTER as u64);
    }
}
