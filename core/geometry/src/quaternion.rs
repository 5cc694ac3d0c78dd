//! Unit quaternions for attitude: the body frame seen from a level frame.

use crate::elementary::{asin, atan2, sin_cos};
use nalgebra::Vector3;
use randt_persist::persist;

/// A rotation: v_fixed = q v_body q*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    /// Real part.
    pub w: f64,
    /// Imaginary part.
    pub x: f64,
    /// Imaginary part.
    pub y: f64,
    /// Imaginary part.
    pub z: f64,
}

persist!(Quaternion { w, x, y, z });

impl Default for Quaternion {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self {
        w: 1.0,
        x: 0.0,
        y: 0.0,
        z: 0.0,
    };

    /// From components (w, x, y, z), normalised; identity if their length is zero or not finite.
    pub fn new(w: f64, x: f64, y: f64, z: f64) -> Self {
        let norm = (w * w + x * x + y * y + z * z).sqrt();
        if norm > 0.0 && norm.is_finite() {
            Self {
                w: w / norm,
                x: x / norm,
                y: y / norm,
                z: z / norm,
            }
        } else {
            Self::IDENTITY
        }
    }

    /// Rotation by a rotation vector (axis times angle, rad).
    pub fn from_rotation_vector(v: Vector3<f64>) -> Self {
        let angle = v.norm();
        let (s, c) = sin_cos(0.5 * angle);
        let scale = if angle < 1e-9 { 0.5 } else { s / angle };
        Self::new(c, v.x * scale, v.y * scale, v.z * scale)
    }

    /// From roll, pitch and yaw (rotations about x, then y, then z of the fixed frame).
    pub fn from_roll_pitch_yaw(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> Self {
        let about = |axis: Vector3<f64>, angle: f64| Self::from_rotation_vector(axis * angle);
        about(Vector3::z(), yaw_rad)
            .multiply(&about(Vector3::y(), pitch_rad))
            .multiply(&about(Vector3::x(), roll_rad))
    }

    /// Roll, pitch, yaw as in [`Quaternion::from_roll_pitch_yaw`].
    pub fn roll_pitch_yaw(&self) -> (f64, f64, f64) {
        let Self { w, x, y, z } = *self;
        let roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
        let pitch = asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0));
        let yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
        (roll, pitch, yaw)
    }

    /// `self` after `other`: rotates first by `other`, then by `self`.
    pub fn multiply(&self, o: &Self) -> Self {
        Self::new(
            self.w * o.w - self.x * o.x - self.y * o.y - self.z * o.z,
            self.w * o.x + self.x * o.w + self.y * o.z - self.z * o.y,
            self.w * o.y - self.x * o.z + self.y * o.w + self.z * o.x,
            self.w * o.z + self.x * o.y - self.y * o.x + self.z * o.w,
        )
    }

    /// The inverse rotation.
    pub fn conjugate(&self) -> Self {
        Self {
            w: self.w,
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }

    /// A vector of the body, seen from the fixed frame.
    pub fn rotate(&self, v: Vector3<f64>) -> Vector3<f64> {
        let q = Vector3::new(self.x, self.y, self.z);
        let t = 2.0 * q.cross(&v);
        v + self.w * t + q.cross(&t)
    }

    /// The shorter way from `self` to `other` by `fraction` in 0..1 (straight line, renormalised).
    pub fn interpolate(&self, other: &Self, fraction: f64) -> Self {
        let dot = self.w * other.w + self.x * other.x + self.y * other.y + self.z * other.z;
        let sign = if dot < 0.0 { -1.0 } else { 1.0 };
        let mix = |a: f64, b: f64| a + (sign * b - a) * fraction;
        Self::new(
            mix(self.w, other.w),
            mix(self.x, other.x),
            mix(self.y, other.y),
            mix(self.z, other.z),
        )
    }

    /// (w, x, y, z).
    pub fn to_array(self) -> [f64; 4] {
        [self.w, self.x, self.y, self.z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angles_survive(roll in -3.0..3.0, pitch in -1.5..1.5, yaw in -3.0..3.0) {
            let (r, p, y) = Quaternion::from_roll_pitch_yaw(roll, pitch, yaw).roll_pitch_yaw();
            prop_assert!((r - roll).abs() < 1e-9 && (p - pitch).abs() < 1e-9 && (y - yaw).abs() < 1e-9);
        }

        #[test]
        fn the_conjugate_turns_back(a in -3.0..3.0, b in -1.5..1.5, c in -3.0..3.0, x in -9.0..9.0) {
            let q = Quaternion::from_roll_pitch_yaw(a, b, c);
            let v = Vector3::new(x, 1.0, -2.0);
            prop_assert!((q.conjugate().rotate(q.rotate(v)) - v).norm() < 1e-12);
        }
    }
}
