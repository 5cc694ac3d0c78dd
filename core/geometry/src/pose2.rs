//! SE(2): a position and a heading in the plane, with its exponential map.
//!
//! Perturbations stand on the right: T Exp(xi), xi = (x, y, yaw) in the moving frame
//! (Sola et al. 2018, "A micro Lie theory", example 7.1 and appendix C).

use crate::elementary::{sin_cos, wrap};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use randt_persist::persist;

/// Below this angle the closed forms lose digits to cancellation; three Taylor terms are exact to
/// 1e-16.
const SMALL_ANGLE_RAD: f64 = 1e-2;

/// A pose in the plane: the frame `b` seen from the frame `a`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose2 {
    /// Position, m.
    pub x_m: f64,
    /// Position, m.
    pub y_m: f64,
    /// Heading, rad, in [-pi, pi). To be read: its sine and cosine are kept with it, so that
    /// another heading is another pose, by [`Self::new`].
    pub yaw_rad: f64,
    cos: f64,
    sin: f64,
}

persist!(Pose2 {
    x_m,
    y_m,
    yaw_rad,
    cos,
    sin
});

impl Default for Pose2 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose2 {
    /// No motion.
    pub const IDENTITY: Self = Self {
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
        cos: 1.0,
        sin: 0.0,
    };

    /// A pose from position and heading; the heading is wrapped.
    pub fn new(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        let yaw_rad = wrap(yaw_rad);
        let (sin, cos) = sin_cos(yaw_rad);
        Self {
            x_m,
            y_m,
            yaw_rad,
            cos,
            sin,
        }
    }

    /// A pose from (x, y, yaw).
    pub fn from_array(pose: [f64; 3]) -> Self {
        Self::new(pose[0], pose[1], pose[2])
    }

    /// (x, y, yaw).
    pub fn to_array(self) -> [f64; 3] {
        [self.x_m, self.y_m, self.yaw_rad]
    }

    /// Position.
    pub fn translation(&self) -> Vector2<f64> {
        Vector2::new(self.x_m, self.y_m)
    }

    /// Cosine and sine of the heading.
    pub fn cos_sin(&self) -> (f64, f64) {
        (self.cos, self.sin)
    }

    /// Rotation matrix.
    pub fn rotation(&self) -> Matrix2<f64> {
        Matrix2::new(self.cos, -self.sin, self.sin, self.cos)
    }

    /// A point of the moving frame, seen from the fixed one.
    pub fn transform(&self, point: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.cos * point.x - self.sin * point.y + self.x_m,
            self.sin * point.x + self.cos * point.y + self.y_m,
        )
    }

    /// `self` then `other` in the moved frame: T_ac = T_ab T_bc.
    pub fn compose(&self, other: &Self) -> Self {
        let position = self.transform(other.translation());
        Self::new(position.x, position.y, self.yaw_rad + other.yaw_rad)
    }

    /// The fixed frame seen from the moving one.
    pub fn inverse(&self) -> Self {
        Self::new(
            -(self.cos * self.x_m + self.sin * self.y_m),
            self.sin * self.x_m - self.cos * self.y_m,
            -self.yaw_rad,
        )
    }

    /// The pose of `other` seen from `self`: self^-1 other.
    pub fn between(&self, other: &Self) -> Self {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        Self::new(
            self.cos * dx + self.sin * dy,
            -self.sin * dx + self.cos * dy,
            other.yaw_rad - self.yaw_rad,
        )
    }

    /// Motion with the constant twist (x, y, yaw) for one unit of time.
    pub fn exp(twist: Vector3<f64>) -> Self {
        let (a, b) = sinc_terms(twist.z);
        Self::new(
            a * twist.x - b * twist.y,
            b * twist.x + a * twist.y,
            twist.z,
        )
    }

    /// The twist whose [`Pose2::exp`] is this pose.
    pub fn log(&self) -> Vector3<f64> {
        let (a, b) = sinc_terms(self.yaw_rad);
        let scale = 1.0 / (a * a + b * b);
        Vector3::new(
            (a * self.x_m + b * self.y_m) * scale,
            (a * self.y_m - b * self.x_m) * scale,
            self.yaw_rad,
        )
    }

    /// Adjoint: T Exp(xi) = Exp(Ad xi) T.
    pub fn adjoint(&self) -> Matrix3<f64> {
        Matrix3::new(
            self.cos, -self.sin, self.y_m, //
            self.sin, self.cos, -self.x_m, //
            0.0, 0.0, 1.0,
        )
    }

    /// Right Jacobian: Exp(xi + d) ~ Exp(xi) Exp(Jr d).
    pub fn right_jacobian(twist: Vector3<f64>) -> Matrix3<f64> {
        let (a, b) = sinc_terms(twist.z);
        let (c, d) = jacobian_terms(twist.z);
        // c = (theta - sin theta) / theta^2, d = (1 - cos theta) / theta^2 (Sola et al., eq. 163).
        let (by_x, by_y) = (c * twist.x - d * twist.y, d * twist.x + c * twist.y);
        Matrix3::new(a, b, by_x, -b, a, by_y, 0.0, 0.0, 1.0)
    }

    /// Inverse of the right Jacobian: Log(T Exp(d)) ~ Log(T) + Jr^-1 d.
    pub fn right_jacobian_inverse(twist: Vector3<f64>) -> Matrix3<f64> {
        let j = Self::right_jacobian(twist);
        // Block form [A w; 0 1]: A is a scaled rotation, so its inverse is its transpose over the
        // scale.
        let scale = 1.0 / (j.m11 * j.m11 + j.m12 * j.m12);
        let (a, b) = (j.m11 * scale, j.m12 * scale);
        let (by_x, by_y) = (-(a * j.m13 - b * j.m23), -(b * j.m13 + a * j.m23));
        Matrix3::new(a, -b, by_x, b, a, by_y, 0.0, 0.0, 1.0)
    }

    /// The pose between `self` (fraction 0) and `other` (1): position straight, heading along the
    /// shorter way round.
    pub fn interpolate(&self, other: &Self, fraction: f64) -> Self {
        Self::new(
            self.x_m + (other.x_m - self.x_m) * fraction,
            self.y_m + (other.y_m - self.y_m) * fraction,
            self.yaw_rad + wrap(other.yaw_rad - self.yaw_rad) * fraction,
        )
    }
}

/// (sin t / t, (1 - cos t) / t).
fn sinc_terms(angle: f64) -> (f64, f64) {
    if angle.abs() < SMALL_ANGLE_RAD {
        let s = angle * angle;
        (
            1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0)),
            angle * (0.5 - s / 24.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0))),
        )
    } else {
        let (sin, cos) = sin_cos(angle);
        (sin / angle, (1.0 - cos) / angle)
    }
}

/// ((t - sin t) / t^2, (1 - cos t) / t^2).
fn jacobian_terms(angle: f64) -> (f64, f64) {
    if angle.abs() < SMALL_ANGLE_RAD {
        let s = angle * angle;
        (
            angle / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0)),
            0.5 - s / 24.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0)),
        )
    } else {
        let (sin, cos) = sin_cos(angle);
        (
            (angle - sin) / (angle * angle),
            (1.0 - cos) / (angle * angle),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-50.0..50.0, -50.0..50.0, -3.1..3.1).prop_map(|(x, y, yaw)| Pose2::new(x, y, yaw))
    }
    fn twist() -> impl Strategy<Value = Vector3<f64>> {
        // Negative, tiny and large angles: other libraries' maps are wrong for negative ones.
        (
            -5.0..5.0,
            -5.0..5.0,
            prop_oneof![-3.1..3.1, -1e-2..1e-2, Just(0.0)],
        )
            .prop_map(|(x, y, t)| Vector3::new(x, y, t))
    }
    fn close(a: &Pose2, b: &Pose2, tolerance: f64) -> bool {
        (a.x_m - b.x_m).abs() < tolerance
            && (a.y_m - b.y_m).abs() < tolerance
            && wrap(a.yaw_rad - b.yaw_rad).abs() < tolerance
    }

    proptest! {
        #[test]
        fn log_undoes_exp(xi in twist()) {
            prop_assert!((Pose2::exp(xi).log() - xi).norm() < 1e-10);
        }

        #[test]
        fn a_pose_and_its_inverse_cancel(a in pose(), b in pose()) {
            prop_assert!(close(&a.compose(&a.inverse()), &Pose2::IDENTITY, 1e-11));
            prop_assert!(close(&a.compose(&a.between(&b)), &b, 1e-11));
        }

        #[test]
        fn exp_in_halves_is_exp_whole(xi in twist()) {
            let half = Pose2::exp(xi * 0.5);
            prop_assert!(close(&half.compose(&half), &Pose2::exp(xi), 1e-11));
        }

        #[test]
        fn the_adjoint_moves_a_perturbation_to_the_left(a in pose(), xi in twist()) {
            prop_assert!(close(&a.compose(&Pose2::exp(xi)), &Pose2::exp(a.adjoint() * xi).compose(&a), 1e-8));
        }

        #[test]
        fn the_right_jacobian_is_the_derivative(xi in twist()) {
            let jacobian = Pose2::right_jacobian(xi);
            let inverse = Pose2::right_jacobian_inverse(xi);
            prop_assert!((jacobian * inverse - Matrix3::identity()).norm() < 1e-9);
            let step = 1e-6;
            for axis in 0..3 {
                let mut d = Vector3::zeros();
                d[axis] = step;
                let column = (Pose2::exp(xi - d).between(&Pose2::exp(xi + d))).log() / (2.0 * step);
                prop_assert!((column - jacobian.column(axis)).norm() < 1e-6, "axis {axis}: {column} {jacobian}");
            }
        }

        #[test]
        fn wrapped_angles_lie_in_one_turn(angle in -1e4..1e4) {
            let w = wrap(angle);
            prop_assert!((-crate::elementary::PI..crate::elementary::PI).contains(&w));
            prop_assert!((crate::elementary::sin(w) - crate::elementary::sin(angle)).abs() < 1e-10);
        }
    }
}
