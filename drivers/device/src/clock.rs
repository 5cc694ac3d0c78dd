//! A device's clock in the host's time.
//!
//! Responsible for the estimate of when something was measured, from the device's own stamp and
//! the moment when it reached the host. Not responsible for the device's constant delay, which
//! cannot be seen from here (`randt calibrate time` can).

use crate::hull::beneath;
use std::collections::VecDeque;

/// The best sample of each of these stretches is kept, ns.
const STRETCH_NS: i64 = 500_000_000;
/// Stretches that are used: half a minute, in which a cheap quartz does not change.
const STRETCHES: usize = 60;
/// The skew is known when samples span this, ns; before that a device is taken to be as fast as
/// the host. In five seconds 200 ppm are a millisecond, as much as the jitter of a message.
const SPAN_MIN_NS: i64 = 5_000_000_000;
/// No quartz is worse; what seems to be is late messages.
const SKEW_MAX: f64 = 1e-3;
/// Where a sample would have been measured this long after it arrived, or is this much later than
/// all before it for [`LATE_STRETCHES_MAX`] stretches, the device's clock was set, ns.
const SET_NS: i64 = 100_000_000;
/// A stopped process reads old samples when it goes on; they are late for as long as its buffer is
/// deep.
const LATE_STRETCHES_MAX: usize = 6;

/// A sample of little delay.
#[derive(Clone, Copy, Debug)]
struct Quick {
    device_ns: i64,
    arrival_ns: i64,
}

impl Quick {
    fn delay_ns(&self) -> i64 {
        self.arrival_ns.saturating_sub(self.device_ns)
    }
}

/// Maps a device's time into the host's: the line beneath all (device time, arrival) of the last
/// half minute that is nearest to them, because messages are late but never early.
///
/// What it gives rises with the device's time, and never by less than half of what that has risen.
#[derive(Clone, Debug, Default)]
pub struct DeviceClock {
    quick: VecDeque<Quick>,
    last: Option<(i64, i64)>,
    /// Stretches in a row of which even the best sample is much too late.
    late_stretches: usize,
    restarts: u64,
}

impl DeviceClock {
    /// When a sample was measured, ns of the host's clock: device time and arrival in.
    pub fn host_ns(&mut self, device_ns: i64, arrival_ns: i64) -> i64 {
        if self.was_set(device_ns, arrival_ns) {
            self.restarts += 1;
            self.quick.clear();
            self.late_stretches = 0;
            self.last = self.last.map(|(_, host_ns)| (device_ns, host_ns));
        }
        self.learn(device_ns, arrival_ns);
        let estimate_ns = self
            .estimate(device_ns)
            .unwrap_or(arrival_ns)
            .min(arrival_ns);
        let host_ns = match self.last {
            None => estimate_ns,
            Some((last_device_ns, last_ns)) => {
                let half = device_ns.saturating_sub(last_device_ns).max(0) / 2;
                estimate_ns.max(last_ns.saturating_add(half.max(1)))
            }
        };
        self.last = Some((device_ns, host_ns));
        host_ns
    }

    /// How often the device's clock was set: begun anew or moved.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// How much faster the device's clock is than the host's; 0 until that is known.
    pub fn skew(&self) -> f64 {
        self.line(0).map_or(0.0, |(_, slope)| -slope)
    }

    fn was_set(&self, device_ns: i64, arrival_ns: i64) -> bool {
        let Some((last_device_ns, _)) = self.last else {
            return false;
        };
        let host_ns = self.estimate(device_ns);
        let early = host_ns.is_some_and(|host_ns| host_ns.saturating_sub(arrival_ns) > SET_NS);
        device_ns < last_device_ns || early || self.late_stretches > LATE_STRETCHES_MAX
    }

    fn learn(&mut self, device_ns: i64, arrival_ns: i64) {
        let sample = Quick {
            device_ns,
            arrival_ns,
        };
        match self.quick.back_mut() {
            Some(last) if device_ns / STRETCH_NS == last.device_ns / STRETCH_NS => {
                if sample.delay_ns() < last.delay_ns() {
                    *last = sample;
                }
            }
            _ => {
                self.judge_last();
                if self.quick.len() == STRETCHES {
                    self.quick.pop_front();
                }
                self.quick.push_back(sample);
            }
        }
    }

    /// A stretch is over: whether even its best sample was much too late.
    fn judge_last(&mut self) {
        let late = self.quick.back().is_some_and(|last| {
            let host_ns = self.estimate(last.device_ns);
            host_ns.is_some_and(|host_ns| last.arrival_ns.saturating_sub(host_ns) > SET_NS)
        });
        self.late_stretches = if late { self.late_stretches + 1 } else { 0 };
    }

    fn estimate(&self, device_ns: i64) -> Option<i64> {
        let least = self.quick.iter().min_by_key(|quick| quick.delay_ns())?;
        let delay_ns = match self.line(device_ns) {
            Some((delay_ns, _)) => least.delay_ns().saturating_add(delay_ns as i64),
            None => least.delay_ns(),
        };
        Some(device_ns.saturating_add(delay_ns))
    }

    /// Delay above the least one at a device time, ns, and its growth; `None` until the skew can
    /// be known.
    fn line(&self, device_ns: i64) -> Option<(f64, f64)> {
        let (first, last) = (self.quick.front()?, self.quick.back()?);
        if last.device_ns.saturating_sub(first.device_ns) < SPAN_MIN_NS {
            return None;
        }
        let least_ns = self.quick.iter().map(Quick::delay_ns).min()?;
        let since_first = |device_ns: i64| device_ns.saturating_sub(first.device_ns) as f64;
        let points = self.quick.iter().map(|quick| {
            let above_ns = quick.delay_ns().saturating_sub(least_ns);
            (since_first(quick.device_ns), above_ns as f64)
        });
        beneath(points, since_first(device_ns)).filter(|(_, slope)| slope.abs() < SKEW_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OFFSET_NS: i64 = 1_700_000_000_000_000_000;

    /// A device of 250 Hz whose clock is faster by `skew`: errors of the estimates against the
    /// truth plus least delay.
    fn errors(
        clock: &mut DeviceClock,
        seconds: i64,
        skew: f64,
        delay_ns: impl Fn(i64) -> i64,
    ) -> Vec<i64> {
        (0..seconds * 250)
            .map(|i| {
                let true_ns = OFFSET_NS + i * 4_000_000;
                let device_ns = (i as f64 * 4e6 * (1.0 + skew)) as i64;
                clock.host_ns(device_ns, true_ns + 500_000 + delay_ns(i)) - true_ns - 500_000
            })
            .collect()
    }

    /// Mostly below a millisecond, at times eight.
    fn bursts(i: i64) -> i64 {
        let random = i.wrapping_mul(6_364_136_223_846_793_005) >> 33;
        (random.rem_euclid(1000) * 1000) + if random % 17 == 0 { 8_000_000 } else { 0 }
    }

    #[test]
    fn late_messages_do_not_disturb_it_whatever_the_skew() {
        for skew in [0.0, 200e-6, -200e-6] {
            let mut clock = DeviceClock::default();
            let errors = errors(&mut clock, 60, skew, bursts);
            let steady = &errors[250 * 10..];
            let worst = steady.iter().map(|e| e.abs()).max().unwrap();
            assert!(worst < 100_000, "skew {skew}: {worst} ns");
            assert!((clock.skew() - skew).abs() < 5e-6, "{}", clock.skew());
            assert_eq!(clock.restarts(), 0);
        }
    }

    #[test]
    fn a_clock_that_is_set_begins_anew() {
        for set_ns in [
            -3_600_000_000_000,
            -5_000_000,
            300_000_000,
            3_600_000_000_000,
        ] {
            let mut clock = DeviceClock::default();
            let mut last_ns = i64::MIN;
            for i in 0..5000_i64 {
                let true_ns = OFFSET_NS + i * 4_000_000;
                let device_ns =
                    7_200_000_000_000 + i * 4_000_000 + if i < 2500 { 0 } else { set_ns };
                let host_ns = clock.host_ns(device_ns, true_ns + bursts(i));
                assert!(host_ns > last_ns);
                last_ns = host_ns;
                let error_ns = host_ns - true_ns;
                assert!(
                    i % 2500 < 500 || error_ns.abs() < 300_000,
                    "{set_ns}: {error_ns} at {i}"
                );
            }
            assert_eq!(clock.restarts(), 1, "{set_ns}");
        }
    }

    #[test]
    fn a_reader_that_was_stopped_finds_its_old_samples_where_they_belong() {
        let mut clock = DeviceClock::default();
        // Stopped from 20 s to 22 s: what came meanwhile is read at once.
        let delay_ns = |i: i64| match i {
            5000..5500 => (5500 - i) * 4_000_000,
            _ => bursts(i),
        };
        let errors = errors(&mut clock, 30, 50e-6, delay_ns);
        let worst = errors[2500..].iter().map(|e| e.abs()).max().unwrap();
        assert!(worst < 100_000, "{worst}");
        assert_eq!(clock.restarts(), 0);
    }

    #[test]
    fn a_clock_that_stood_still_is_noticed() {
        let mut clock = DeviceClock::default();
        let delay_ns = |i: i64| bursts(i) + if i < 2500 { 0 } else { 2_000_000_000 };
        let errors = errors(&mut clock, 30, 0.0, delay_ns);
        assert_eq!(clock.restarts(), 1);
        // From then on the new delay is part of the offset: nothing else can be known.
        assert!(
            errors[5000..]
                .iter()
                .all(|e| (e - 2_000_000_000).abs() < 1_000_000)
        );
    }

    proptest! {
        /// For any input it rises and does not panic.
        #[test]
        fn it_rises_whatever_comes(samples in prop::collection::vec((any::<i64>(), any::<i64>()), 1..200)) {
            let mut clock = DeviceClock::default();
            let mut last = None;
            for (device_ns, arrival_ns) in samples {
                let host_ns = clock.host_ns(device_ns, arrival_ns);
                prop_assert!(last.is_none_or(|last| host_ns > last) || host_ns == i64::MAX);
                last = Some(host_ns);
            }
        }
    }
}
