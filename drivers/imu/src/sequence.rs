//! What is missing between readings, and how often they really come.

use crate::Reading;

/// A longer step than this is a device that was away, ns.
const AWAY_NS: i64 = 10_000_000_000;
/// How slowly the usual interval follows: it is a running mean to which no step counts more than an interval, so that
/// lost readings hardly move it.
const SLOWNESS: f64 = 64.0;
/// Readings after which the usual interval is known.
const KNOWN_AFTER: u64 = 250;
/// The device may be off its rate by this share: quartzes are not, dividers are.
const TOLERANCE: f64 = 0.1;

/// Counts lost readings by the device's own number, or else by its time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sequence {
    last: Option<Reading>,
    usual_ns: f64,
    asked_ns: i64,
    seen: u64,
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
            (self.asked_ns, self.usual_ns, self.seen) = (interval_ns, interval_ns as f64, 0);
        }
        let last = self.last.replace(*reading);
        let Some(last) = last else {
            return;
        };
        self.seen += 1;
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
            let most = self.asked_ns as f64;
            let off = step_ns as f64 - self.usual_ns;
            self.usual_ns += off.clamp(-most, most) / SLOWNESS;
        }
    }

    /// Readings that are missing.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }

    /// Readings a second as they come, and as they should, where these differ.
    pub(crate) fn wrong_rate(&self) -> Option<(f64, f64)> {
        let asked_ns = self.asked_ns as f64;
        let known = self.seen > KNOWN_AFTER;
        let wrong = (self.usual_ns / asked_ns - 1.0).abs() > TOLERANCE;
        (known && wrong).then(|| (1e9 / self.usual_ns, 1e9 / asked_ns))
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
            // A millisecond's grain, as Phidgets have it.
            by_time.push(
                &at(Some(i * 4_000_000 + i % 2 * 1_000_000), None),
                4_000_000,
            );
            by_number.push(&at(None, Some((65_000 + i) as u16)), 4_000_000);
        }
        assert_eq!((by_time.lost(), by_number.lost()), (8, 8));
        assert_eq!(by_time.wrong_rate(), None);
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
        assert!(sequence.lost() < 50);
    }
}
