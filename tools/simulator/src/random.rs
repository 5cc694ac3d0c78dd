//! Random numbers that are the same everywhere and without end: SplitMix64.
//!
//! Written here and not taken from a crate, because a log must be the same bytes from the same
//! seed after years of updates. Not for secrets.

use randt_geometry::elementary::{PI, ln, sin_cos};

/// A stream of random numbers (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
/// generators").
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream of a seed. `purpose` makes independent streams of one seed, so that more numbers
    /// for one thing do not change another.
    pub fn new(seed: u64, purpose: u64) -> Self {
        let mut base = Self { state: seed };
        let mixed = base.next_u64();
        Self {
            state: mixed ^ purpose.wrapping_mul(0xd134_2543_de82_ef95),
        }
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = self.state;
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly in [0, 1).
    pub fn unit(&mut self) -> f64 {
        // 53 bits fill a double's mantissa.
        (self.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Evenly in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Exponential with mean 1.
    pub fn exponential(&mut self) -> f64 {
        // 1 - u lies in (0, 1].
        -ln(1.0 - self.unit())
    }

    /// Two independent normal numbers of variance 1 (Box and Muller).
    pub fn normal_pair(&mut self) -> (f64, f64) {
        let radius = (2.0 * self.exponential()).sqrt();
        let (sin, cos) = sin_cos(2.0 * PI * self.unit());
        (radius * cos, radius * sin)
    }

    /// Normal with variance 1.
    pub fn normal(&mut self) -> f64 {
        self.normal_pair().0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_the_published_one() {
        // First outputs of SplitMix64 for the seed 1234567.
        let mut random = Random { state: 1_234_567 };
        assert_eq!(random.next_u64(), 6_457_827_717_110_365_317);
        assert_eq!(random.next_u64(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn moments_are_right() {
        let mut random = Random::new(1, 2);
        let n = 100_000;
        let (mut mean, mut square, mut exponential) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = random.normal();
            mean += x / f64::from(n);
            square += x * x / f64::from(n);
            exponential += random.exponential() / f64::from(n);
        }
        assert!(
            mean.abs() < 0.02 && (square - 1.0).abs() < 0.02,
            "{mean} {square}"
        );
        assert!((exponential - 1.0).abs() < 0.02, "{exponential}");
    }
}
