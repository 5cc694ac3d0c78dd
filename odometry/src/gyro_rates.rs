//! The gyro's rates sample by sample: spikes, and a value that repeats.

use randt_persist::persist;

/// A rate that differs from those before and after it by more, rad/s, and by more per time,
/// rad/s^2, is no turn of a robot but a spike.
const SPIKE_RAD_S: f64 = 1.0;
const SPIKE_RAD_S2: f64 = 100.0;
/// Time over which a rate that stays the same to the last bit is repeated and not measured, ns.
const REPEATED_NS: i64 = 100_000_000;
/// A gyro that ends at its largest rate repeats it that often: once it may be chance.
const CLIPS_MIN: u64 = 3;
/// Rates that small are those of a robot that stands, which a coarse gyro repeats, rad/s.
const STANDING_RAD_S: f64 = 0.02;

/// A rate that was repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeated {
    /// The rate, rad/s.
    pub rate_rad_s: f64,
    /// Whether no rate was larger.
    pub is_largest: bool,
}

/// Follows the rates.
#[derive(Clone, Copy, Debug, Default)]
pub struct GyroRates {
    /// The last rate, as it was measured and as it was given out, and since when it is the same.
    last_rad_s: f64,
    given_rad_s: f64,
    last_ns: i64,
    since_ns: i64,
    largest_rad_s: f64,
    /// The last rate that was repeated, and when.
    repeated_rad_s: f64,
    repeated_ns: Option<i64>,
    /// How often the largest rate was repeated.
    clips: u64,
    /// Samples that were spikes.
    pub spikes: u64,
}

persist!(GyroRates {
    last_rad_s,
    given_rad_s,
    last_ns,
    since_ns,
    largest_rad_s,
    repeated_rad_s,
    repeated_ns,
    clips,
    spikes,
} sound has_room);

impl GyroRates {
    fn has_room(&self) -> bool {
        self.spikes.max(self.clips) <= u64::MAX / 2
    }

    /// Takes a rate; gives it, or in a spike's place the one before.
    pub fn push(&mut self, stamp_ns: i64, rate_rad_s: f64) -> f64 {
        let dt_ns = stamp_ns.saturating_sub(self.last_ns);
        let is_first = self.last_ns == 0;
        let limit_rad_s = SPIKE_RAD_S.max(SPIKE_RAD_S2 * dt_ns as f64 * 1e-9);
        let jumps = |from_rad_s: f64| (rate_rad_s - from_rad_s).abs() > limit_rad_s;
        let is_spike = !is_first && jumps(self.given_rad_s) && jumps(self.last_rad_s);
        if is_first || rate_rad_s != self.last_rad_s {
            self.since_ns = stamp_ns;
        }
        (self.last_ns, self.last_rad_s) = (stamp_ns, rate_rad_s);
        if is_spike {
            self.spikes += 1;
            return self.given_rad_s;
        }
        self.given_rad_s = rate_rad_s;
        self.largest_rad_s = self.largest_rad_s.max(rate_rad_s.abs());
        let repeated_ns = stamp_ns.saturating_sub(self.since_ns);
        if repeated_ns >= REPEATED_NS && rate_rad_s.abs() > STANDING_RAD_S {
            let is_new = repeated_ns.saturating_sub(dt_ns) < REPEATED_NS;
            let is_largest = rate_rad_s.abs() >= self.largest_rad_s;
            self.clips += u64::from(is_new && is_largest);
            (self.repeated_rad_s, self.repeated_ns) = (rate_rad_s, Some(stamp_ns));
        }
        rate_rad_s
    }

    /// How often the largest rate was repeated, where that is no chance.
    pub fn clips(&self) -> u64 {
        match self.clips {
            chance if chance < CLIPS_MIN => 0,
            clips => clips,
        }
    }

    /// The largest rate.
    pub fn largest_rad_s(&self) -> f64 {
        self.largest_rad_s
    }

    /// The rate that was repeated at some time since an instant.
    pub fn repeated_since(&self, stamp_ns: i64) -> Option<Repeated> {
        self.repeated_ns.filter(|at_ns| *at_ns >= stamp_ns)?;
        Some(Repeated {
            rate_rad_s: self.repeated_rad_s,
            is_largest: self.repeated_rad_s.abs() >= self.largest_rad_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: i64 = 4_000_000;

    fn pushed(rates: impl IntoIterator<Item = f64>) -> (Vec<f64>, GyroRates) {
        let mut watched = GyroRates::default();
        let stamps = (1..).map(|number| number * STEP_NS);
        let given = stamps.zip(rates).map(|(ns, rate)| watched.push(ns, rate));
        (given.collect(), watched)
    }

    #[test]
    fn a_spike_is_left_out_and_a_step_is_not() {
        let (given, rates) = pushed([0.1, 0.2, 5.2, 0.3, 0.4]);
        assert_eq!((given, rates.spikes), (vec![0.1, 0.2, 0.2, 0.3, 0.4], 1));
        let (given, _) = pushed([0.1, 2.0, 2.1, 2.2]);
        assert_eq!(given, [0.1, 0.1, 2.1, 2.2]);
        let spin = (0..100).map(|i| 0.04 * f64::from(i));
        assert_eq!(pushed(spin).1.spikes, 0);
    }

    #[test]
    fn a_rate_that_repeats_is_the_largest_or_not() {
        let turning = (0..100).map(|i| 0.003 * f64::from(i));
        let (_, rates) = pushed(turning.clone());
        assert_eq!(rates.repeated_since(0), None);
        let (_, rates) = pushed(turning.clone().chain([0.297; 40]));
        let repeated = rates.repeated_since(0).unwrap();
        assert!(repeated.is_largest && repeated.rate_rad_s == 0.297);
        assert_eq!(rates.clips(), 0);
        let (_, rates) = pushed(turning.clone().chain([0.2; 40]));
        assert!(!rates.repeated_since(0).unwrap().is_largest);
        assert_eq!(rates.clips(), 0);
        // It ends there, turn by turn.
        let turns = (0..4).flat_map(|_| turning.clone().chain([0.297; 40]));
        let (_, rates) = pushed(turns);
        assert_eq!((rates.clips(), rates.largest_rad_s()), (4, 0.297));
        let (_, rates) = pushed(turning.chain([0.2; 40]));
        // Long ago it was so.
        assert_eq!(rates.repeated_since(i64::MAX), None);
        // A coarse gyro of a robot that stands.
        assert_eq!(pushed([0.001; 100]).1.repeated_since(0), None);
    }
}
