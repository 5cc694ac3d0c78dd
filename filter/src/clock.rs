//! The sequence of an IMU's stamps: which sample is a step, which a new start, which to ignore.
//!
//! Responsible for judging and counting. Not responsible for what a filter does with the time that
//! passed.

use nalgebra::Vector3;
use randt_persist::persist;

/// The longest gap that is a step. After a longer one, or a step back of that length, the clock
/// was set or the log broke off, and nothing is bridged.
const GAP_MAX_NS: i64 = 1_000_000_000;

/// The largest rate or specific force of a real sensor, in any unit; beyond it squares might
/// overflow.
const VALUE_MAX: f64 = 1e6;

/// How a sample relates to the one before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// That many seconds after the one before.
    Step(f64),
    /// The first one, or the first after the stamps broke off.
    Start,
    /// Not to be used: not finite, or not after the one before.
    Ignored,
}

/// Judges samples by their stamps and values.
#[derive(Clone, Debug, Default)]
pub struct SampleClock {
    last_ns: Option<i64>,
    breaks: u64,
    not_after: u64,
    not_finite: u64,
}

persist!(SampleClock { last_ns, breaks, not_after, not_finite } sound has_room);

impl SampleClock {
    /// Whether it can go on counting.
    fn has_room(&self) -> bool {
        self.breaks.max(self.not_after).max(self.not_finite) <= u64::MAX / 2
    }

    /// Judges one sample and moves on to it unless it is ignored.
    pub fn step(
        &mut self,
        stamp_ns: i64,
        rate_rad_s: &Vector3<f64>,
        acceleration_m_s2: &Vector3<f64>,
    ) -> Pace {
        let mut values = rate_rad_s.iter().chain(acceleration_m_s2.iter());
        // False for a NaN, too.
        if !values.all(|v| v.abs() < VALUE_MAX) {
            self.not_finite += 1;
            return Pace::Ignored;
        }
        let Some(last_ns) = self.last_ns else {
            self.last_ns = Some(stamp_ns);
            return Pace::Start;
        };
        let elapsed_ns = stamp_ns.saturating_sub(last_ns);
        if (-GAP_MAX_NS..=0).contains(&elapsed_ns) {
            self.not_after += 1;
            return Pace::Ignored;
        }
        self.last_ns = Some(stamp_ns);
        if (1..=GAP_MAX_NS).contains(&elapsed_ns) {
            Pace::Step(elapsed_ns as f64 * 1e-9)
        } else {
            self.breaks += 1;
            Pace::Start
        }
    }

    /// How often the stamps broke off: a gap or a step back of over a second.
    pub fn breaks(&self) -> u64 {
        self.breaks
    }

    /// Samples that were ignored because their stamp repeated or went back a little.
    pub fn not_after(&self) -> u64 {
        self.not_after
    }

    /// Samples that were ignored because a value was no number that a sensor can give.
    pub fn not_finite(&self) -> u64 {
        self.not_finite
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_and_broken_samples_are_counted_and_a_set_back_clock_starts_anew() {
        let mut clock = SampleClock::default();
        let zero = Vector3::zeros();
        let nan = Vector3::new(0.0, f64::NAN, 0.0);
        assert_eq!(clock.step(5_000_000_000, &zero, &zero), Pace::Start);
        assert_eq!(clock.step(5_000_000_000, &zero, &zero), Pace::Ignored);
        assert_eq!(clock.step(4_999_000_000, &zero, &zero), Pace::Ignored);
        assert_eq!(clock.step(5_250_000_000, &zero, &nan), Pace::Ignored);
        assert_eq!(clock.step(5_500_000_000, &zero, &zero), Pace::Step(0.5));
        assert_eq!(clock.step(1_000_000_000, &zero, &zero), Pace::Start);
        assert_eq!(clock.step(1_250_000_000, &zero, &zero), Pace::Step(0.25));
        assert_eq!(clock.step(2_250_000_001, &zero, &zero), Pace::Start);
        assert_eq!(
            (clock.breaks(), clock.not_after(), clock.not_finite()),
            (2, 2, 1)
        );
    }
}
