//! Slopes: what a tilted sensor measures, brought into the level plane.

use nalgebra::{Vector2, Vector3};
use randt_persist::persist;

/// Roll and pitch of the robot, as what they do to ranges and to the yaw rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tilt {
    sin_pitch: f64,
    cos_pitch: f64,
    sin_roll: f64,
    cos_roll: f64,
}

/// Cosine of the pitch from which heading means nothing (80 degrees).
const COS_PITCH_MIN: f64 = 0.17;

impl Default for Tilt {
    fn default() -> Self {
        Self::LEVEL
    }
}

persist!(Tilt {
    sin_pitch,
    cos_pitch,
    sin_roll,
    cos_roll
});

impl Tilt {
    /// Upright.
    pub const LEVEL: Self = Self {
        sin_pitch: 0.0,
        cos_pitch: 1.0,
        sin_roll: 0.0,
        cos_roll: 1.0,
    };

    /// From the unit vector that points up, in the robot's frame.
    pub fn from_up(up: Vector3<f64>) -> Self {
        // up = R^T e_z = (-sin pitch, cos pitch sin roll, cos pitch cos roll).
        let sin_pitch = -up.x;
        let cos_pitch = (1.0 - up.x * up.x).max(0.0).sqrt();
        if cos_pitch < COS_PITCH_MIN || !cos_pitch.is_finite() {
            return Self::LEVEL;
        }
        Self {
            sin_pitch,
            cos_pitch,
            sin_roll: up.y / cos_pitch,
            cos_roll: up.z / cos_pitch,
        }
    }

    /// A point of the robot's x-y plane, in the level frame of the same heading.
    pub fn level(&self, p: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.cos_pitch * p.x + self.sin_pitch * self.sin_roll * p.y,
            self.cos_roll * p.y,
        )
    }

    /// How fast the heading turns for an angular rate of the body, rad/s.
    pub fn yaw_rate_rad_s(&self, rate: Vector3<f64>) -> f64 {
        (rate.y * self.sin_roll + rate.z * self.cos_roll) / self.cos_pitch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Quaternion;

    #[test]
    fn a_point_seen_on_a_slope_is_where_the_rotation_puts_it() {
        for (roll, pitch) in [(0.1, -0.2), (-0.3, 0.25), (0.0, 0.0)] {
            let q = Quaternion::from_roll_pitch_yaw(roll, pitch, 0.0);
            let tilt = Tilt::from_up(q.conjugate().rotate(Vector3::z()));
            let p = Vector2::new(3.0, -2.0);
            let expected = q.rotate(Vector3::new(p.x, p.y, 0.0)).xy();
            assert!((tilt.level(p) - expected).norm() < 1e-12);
        }
    }

    #[test]
    fn turning_on_a_slope_is_turning_of_the_heading() {
        let q = Quaternion::from_roll_pitch_yaw(0.2, -0.3, 0.7);
        let tilt = Tilt::from_up(q.conjugate().rotate(Vector3::z()));
        // The body turns by 0.4 rad/s about the vertical.
        let rate = q.conjugate().rotate(Vector3::new(0.0, 0.0, 0.4));
        let dt = 1e-5;
        let later = q
            .multiply(&Quaternion::from_rotation_vector(rate * dt))
            .roll_pitch_yaw()
            .2;
        assert!((tilt.yaw_rate_rad_s(rate) - (later - 0.7) / dt).abs() < 1e-4);
        assert!((tilt.yaw_rate_rad_s(rate) - 0.4).abs() < 1e-9);
    }
}
