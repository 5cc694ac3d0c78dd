//! The attitude filter: gyro and accelerometer to roll, pitch and a free-running heading.
//!
//! Responsible for the quaternion of the IMU's body in a level frame. Not responsible for the
//! gyro's bias, which its owner sets, nor for the true heading, which cannot be observed without a
//! magnetometer. The complementary filter of Valenti, Dryanovski and Xiao, "Keeping a Good
//! Attitude" (Sensors 2015).

use crate::clock::{Pace, SampleClock};
use nalgebra::Vector3;
use randt_geometry::{Quaternion, elementary};
use randt_persist::persist;

/// Standard gravity; its local deviation is far below the tolerance of the gain.
const GRAVITY_M_S2: f64 = 9.806_65;

/// Complementary filter: the gyro predicts, the accelerometer corrects the tilt and never the
/// heading.
///
/// ```
/// use nalgebra::Vector3;
/// use randt_filter::AttitudeFilter;
///
/// let mut filter = AttitudeFilter::new(&Default::default());
/// for i in 0..=250 {
///     // Half a radian a second to the left, lying flat.
///     filter.push(i * 4_000_000, Vector3::new(0.0, 0.0, 0.5), Vector3::new(0.0, 0.0, 9.81));
/// }
/// let (_, _, yaw_rad) = filter.attitude().roll_pitch_yaw();
/// assert!((yaw_rad - 0.5).abs() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct AttitudeFilter {
    correction_time_s: f64,
    gravity_tolerance: f64,
    bias_rad_s: Vector3<f64>,
    clock: SampleClock,
    last_rate_rad_s: Vector3<f64>,
    /// Seconds of trusted gravity since the start or the last break.
    averaged_s: f64,
    attitude: Option<Quaternion>,
}

persist!(AttitudeFilter {
    bias_rad_s,
    clock,
    last_rate_rad_s,
    averaged_s,
    attitude,
} kept {
    correction_time_s,
    gravity_tolerance,
});

impl AttitudeFilter {
    /// A filter that waits for its first sample.
    pub fn new(attitude: &randt_config::Attitude) -> Self {
        Self {
            correction_time_s: attitude.correction_time_s,
            gravity_tolerance: attitude.gravity_tolerance,
            bias_rad_s: Vector3::zeros(),
            clock: SampleClock::default(),
            last_rate_rad_s: Vector3::zeros(),
            averaged_s: 0.0,
            attitude: None,
        }
    }

    /// The gyro's bias, rad/s in the body, that is taken off every rate from now on; zero at
    /// first. Callers who take it off themselves leave it.
    pub fn set_bias(&mut self, bias_rad_s: Vector3<f64>) {
        if bias_rad_s.iter().all(|b| b.is_finite()) {
            self.bias_rad_s = bias_rad_s;
        }
    }

    /// Starts from an attitude of before: its heading goes on, the tilt comes from gravity.
    pub fn start_from(&mut self, attitude: Quaternion) {
        self.attitude = Some(attitude);
    }

    /// Takes one sample: angular rate, rad/s, and specific force, m/s^2, in the body.
    ///
    /// Samples that do not advance the time or are not finite are ignored and counted. Over a gap
    /// of up to a second the rate is taken as linear; over a longer one, or where the clock was
    /// set back, the turning is unknown: the heading stays and the tilt is taken anew from
    /// gravity.
    pub fn push(
        &mut self,
        stamp_ns: i64,
        rate_rad_s: Vector3<f64>,
        acceleration_m_s2: Vector3<f64>,
    ) -> Pace {
        let pace = self.clock.step(stamp_ns, &rate_rad_s, &acceleration_m_s2);
        let rate = rate_rad_s - self.bias_rad_s;
        match pace {
            Pace::Ignored => return pace,
            Pace::Start => {
                self.averaged_s = 0.0;
                let level = self.attitude.unwrap_or_default();
                // What is not gravity shows no tilt.
                let share = self.trust_in(acceleration_m_s2);
                self.attitude = Some(corrected(level, acceleration_m_s2, share));
            }
            Pace::Step(dt_s) => {
                let before = self.last_rate_rad_s;
                // The rotation vector of a linearly changing rate; the cross product is coning.
                let turn =
                    (before + rate) * (0.5 * dt_s) + before.cross(&rate) * (dt_s * dt_s / 12.0);
                let turned = Quaternion::from_rotation_vector(turn);
                let predicted = self.attitude().multiply(&turned);
                let weight_s = dt_s * self.trust_in(acceleration_m_s2);
                // At first a running mean of gravity, then an exponential one.
                let memory_s = (self.averaged_s + dt_s).min(self.correction_time_s);
                let share = (weight_s / memory_s).min(1.0);
                self.averaged_s += weight_s;
                self.attitude = Some(corrected(predicted, acceleration_m_s2, share));
            }
        }
        self.last_rate_rad_s = rate;
        pace
    }

    /// The body in a level frame (z up, heading zero at the start); identity before the first
    /// sample.
    pub fn attitude(&self) -> Quaternion {
        self.attitude.unwrap_or_default()
    }

    /// The vertical, upwards, in the body; of length one.
    pub fn up_in_body(&self) -> Vector3<f64> {
        self.attitude().conjugate().rotate(Vector3::z())
    }

    /// The part of a rate, rad/s in the body, that turns about the vertical, counter-clockwise
    /// seen from above. The bias of [`Self::set_bias`] is taken off.
    pub fn yaw_rate_rad_s(&self, rate_rad_s: Vector3<f64>) -> f64 {
        (rate_rad_s - self.bias_rad_s).dot(&self.up_in_body())
    }

    /// Samples that were ignored and breaks that were met.
    pub fn clock(&self) -> &SampleClock {
        &self.clock
    }

    /// Whole while the specific force is as strong as gravity, falling to zero at twice the
    /// tolerance.
    fn trust_in(&self, acceleration_m_s2: Vector3<f64>) -> f64 {
        let deviation = (acceleration_m_s2.norm() / GRAVITY_M_S2 - 1.0).abs();
        (2.0 - deviation / self.gravity_tolerance).clamp(0.0, 1.0)
    }
}

/// Turns an attitude about a level axis, by a share of what would make the specific force point
/// upwards.
fn corrected(attitude: Quaternion, acceleration_m_s2: Vector3<f64>, share: f64) -> Quaternion {
    let force = attitude.rotate(acceleration_m_s2);
    let level = (force.x * force.x + force.y * force.y).sqrt();
    let angle = share * elementary::atan2(level, force.z);
    // A force straight down leaves the axis open: forwards is as good as any.
    let axis = match level > 0.0 {
        true => Vector3::new(force.y / level, -force.x / level, 0.0),
        false => Vector3::x(),
    };
    Quaternion::from_rotation_vector(axis * angle).multiply(&attitude)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP_NS: i64 = 4_000_000;

    fn filter() -> AttitudeFilter {
        AttitudeFilter::new(&randt_config::Attitude::default())
    }

    fn gravity_in(attitude: &Quaternion) -> Vector3<f64> {
        attitude
            .conjugate()
            .rotate(Vector3::new(0.0, 0.0, GRAVITY_M_S2))
    }

    #[test]
    fn the_first_sample_gives_the_tilt_even_upside_down() {
        for (roll, pitch) in [
            (0.3, -0.2),
            (elementary::PI, 0.0),
            (3.0, 0.4),
            (0.0, -elementary::PI),
        ] {
            let truth = Quaternion::from_roll_pitch_yaw(roll, pitch, 0.0);
            let mut filter = filter();
            filter.push(0, Vector3::zeros(), gravity_in(&truth));
            let up = truth.conjugate().rotate(Vector3::z());
            assert!(
                (filter.up_in_body() - up).norm() < 1e-9,
                "roll {roll} pitch {pitch}"
            );
        }
    }

    #[test]
    fn coning_motion_is_followed() {
        // The body's axis runs round a cone at 2 Hz: the mean rates alone would miss the turning
        // about z.
        let truth = |t: f64| {
            let (s, c) = elementary::sin_cos(4.0 * elementary::PI * t);
            Quaternion::from_rotation_vector(Vector3::new(0.5 * c, 0.5 * s, 0.0))
        };
        let mut filter = filter();
        let rate = |t: f64| {
            let h = 1e-5;
            let turn = truth(t - h).conjugate().multiply(&truth(t + h));
            Vector3::new(turn.x, turn.y, turn.z) * (2.0 / (2.0 * h))
        };
        for i in 0..=5000 {
            let t = i as f64 * 0.004;
            filter.push(i * STEP_NS, rate(t), gravity_in(&truth(t)));
        }
        let error = filter.attitude().multiply(&truth(20.0).conjugate());
        // 40 cones of 44 degrees of apparent turning each; without the cross product it is 0.08 %.
        let error_deg = (2.0 * error.z).to_degrees();
        assert!(
            error_deg.abs() < 0.0005 * 40.0 * 44.0,
            "off by {error_deg} degrees"
        );
    }

    #[test]
    fn a_wrong_tilt_decays_and_a_push_is_not_taken_for_gravity() {
        let mut filter = filter();
        let upright = Vector3::new(0.0, 0.0, GRAVITY_M_S2);
        filter.push(0, Vector3::zeros(), Vector3::new(3.0, 0.0, 9.3));
        for i in 1..=5000 {
            filter.push(i * STEP_NS, Vector3::zeros(), upright);
        }
        assert!(filter.up_in_body().z > 0.999_99);
        let still = filter.up_in_body();
        for i in 5001..=5100 {
            filter.push(i * STEP_NS, Vector3::zeros(), Vector3::new(8.0, 0.0, 9.8));
        }
        assert_eq!(filter.up_in_body(), still);
    }

    #[test]
    fn the_yaw_rate_has_tilt_and_bias_taken_out() {
        let truth = Quaternion::from_roll_pitch_yaw(0.2, 0.1, 0.0);
        let bias = Vector3::new(0.01, -0.02, 0.03);
        let rate = truth.conjugate().rotate(Vector3::new(0.0, 0.0, 0.4)) + bias;
        let mut filter = filter();
        filter.set_bias(bias);
        filter.push(0, rate, gravity_in(&truth));
        assert!((filter.yaw_rate_rad_s(rate) - 0.4).abs() < 1e-12);
    }

    #[test]
    fn a_gap_of_a_second_is_bridged_and_a_longer_one_is_not() {
        let rate = Vector3::new(0.0, 0.0, 0.5);
        let up = Vector3::new(0.0, 0.0, GRAVITY_M_S2);
        let heading = |f: &AttitudeFilter| f.attitude().roll_pitch_yaw().2;
        let mut filter = filter();
        filter.push(0, rate, up);
        assert_eq!(filter.push(900_000_000, rate, up), Pace::Step(0.9));
        assert!((heading(&filter) - 0.45).abs() < 1e-9);
        assert_eq!(filter.push(2_000_000_000, rate, up), Pace::Start);
        assert!((heading(&filter) - 0.45).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn hostile_samples_leave_a_rotation(
            samples in prop::collection::vec(
                (any::<i64>(), prop::array::uniform6(prop::num::f64::ANY)), 1..60),
        ) {
            let mut filter = filter();
            for (stamp, v) in samples {
                filter.push(stamp, Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
                let q = filter.attitude();
                prop_assert!((q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1.0).abs() < 1e-9);
            }
        }
    }
}
