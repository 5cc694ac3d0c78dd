//! How an IMU is mounted: where up is by gravity, and whether that is upside down.
//!
//! Responsible for a decision early in a recording or after power-up. Not responsible for the
//! attitude of a moving robot: the attitude filter is.

use crate::clock::{Pace, SampleClock};
use nalgebra::Vector3;

/// Gravity is averaged over this time before the decision: several periods of a body's swing on
/// its wheels.
const AVERAGED_S: f64 = 0.5;

/// Below this share of the vertical on the z axis neither up nor down is decided (a tilt of 60
/// degrees).
const UPRIGHT_MIN: f64 = 0.5;

/// Which way the IMU's z axis points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mounting {
    /// z up, as REP-103 has it.
    Upright,
    /// z down: hung upside down, or its axes have other signs.
    UpsideDown,
    /// z nearer to level than to the vertical.
    OnItsSide,
}

/// Watches the specific force until the mounting is known.
#[derive(Clone, Debug, Default)]
pub struct MountingCheck {
    clock: SampleClock,
    begin_ns: i64,
    first_ns: Option<i64>,
    count: f64,
    sum: Vector3<f64>,
    result: Option<MountingResult>,
}

/// How gravity shows the IMU to be mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountingResult {
    /// Which way z points.
    pub mounting: Mounting,
    /// The vertical, upwards, in the body; of length one.
    pub up: Vector3<f64>,
    /// Seconds after the first sample at which it was known.
    pub known_after_s: f64,
}

impl MountingResult {
    /// The body's axis nearest to the vertical, such as `-z`.
    pub fn up_axis(&self) -> &'static str {
        let axes = self.up.iter().enumerate();
        let (axis, value) = axes.fold((2, 0.0_f64), |best, (i, &v)| {
            if v.abs() > best.1.abs() { (i, v) } else { best }
        });
        match (axis, value < 0.0) {
            (0, false) => "+x",
            (0, true) => "-x",
            (1, false) => "+y",
            (1, true) => "-y",
            (_, false) => "+z",
            (_, true) => "-z",
        }
    }
}

impl MountingCheck {
    /// Takes one sample: specific force, m/s^2, in the body. Gives the result as soon as it is
    /// there.
    pub fn push(
        &mut self,
        stamp_ns: i64,
        acceleration_m_s2: Vector3<f64>,
    ) -> Option<MountingResult> {
        if self.result.is_some() {
            return self.result;
        }
        let no_rate = Vector3::zeros();
        match self.clock.step(stamp_ns, &no_rate, &acceleration_m_s2) {
            Pace::Ignored => return None,
            Pace::Start => self.begin(stamp_ns),
            Pace::Step(_) => {}
        }
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        self.count += 1.0;
        self.sum += acceleration_m_s2;
        if stamp_ns.saturating_sub(self.begin_ns) as f64 * 1e-9 < AVERAGED_S {
            return None;
        }
        let mean = self.sum / self.count;
        let strength = mean.norm();
        self.begin(stamp_ns);
        // Half to one and a half times gravity: the robot may be accelerating, but does not fall.
        if !(5.0..15.0).contains(&strength) {
            return None;
        }
        let up = mean / strength;
        let mounting = match up.z {
            z if z > UPRIGHT_MIN => Mounting::Upright,
            z if z < -UPRIGHT_MIN => Mounting::UpsideDown,
            _ => Mounting::OnItsSide,
        };
        self.result = Some(MountingResult {
            mounting,
            up,
            known_after_s: stamp_ns.saturating_sub(first_ns) as f64 * 1e-9,
        });
        self.result
    }

    fn begin(&mut self, stamp_ns: i64) {
        self.begin_ns = stamp_ns;
        self.count = 0.0;
        self.sum = Vector3::zeros();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(force: Vector3<f64>) -> Option<MountingResult> {
        let mut check = MountingCheck::default();
        (0..500).find_map(|i| check.push(i * 4_000_000, force))
    }

    #[test]
    fn gravity_shows_up_and_down() {
        for (force, mounting, axis) in [
            (Vector3::new(0.3, 0.0, 9.8), Mounting::Upright, "+z"),
            (Vector3::new(-0.2, -0.1, -9.87), Mounting::UpsideDown, "-z"),
            (Vector3::new(0.2, -9.7, 1.0), Mounting::OnItsSide, "-y"),
        ] {
            let result = result(force).unwrap();
            assert_eq!((result.mounting, result.up_axis()), (mounting, axis));
            assert!((result.known_after_s - 0.5).abs() < 0.01);
        }
    }

    #[test]
    fn a_sensor_without_gravity_gives_no_result() {
        assert_eq!(result(Vector3::zeros()), None);
        assert_eq!(result(Vector3::repeat(f64::NAN)), None);
    }
}
