//! A motion in the plane as a matrix, just as it was read.

use randt_geometry::{Pose2, elementary};

/// The first two rows of a planar motion's matrix: [a b x; c d y].
///
/// Published KITTI figures are made with the matrices as they are printed. Their six digits are no
/// exact rotations, which shows in the mean rotation error; made exact here, the figures would not
/// be met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
    /// Position, m.
    pub x_m: f64,
    /// Position, m.
    pub y_m: f64,
}

impl From<Pose2> for Transform {
    fn from(pose: Pose2) -> Self {
        let (cos, sin) = pose.cos_sin();
        Self {
            a: cos,
            b: -sin,
            c: sin,
            d: cos,
            x_m: pose.x_m,
            y_m: pose.y_m,
        }
    }
}

impl Transform {
    /// From the rows [a b x] and [c d y].
    pub fn from_rows([a, b, x_m]: [f64; 3], [c, d, y_m]: [f64; 3]) -> Self {
        Self {
            a,
            b,
            c,
            d,
            x_m,
            y_m,
        }
    }

    /// Position and heading of the moving frame's x axis.
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.x_m, self.y_m, elementary::atan2(self.c, self.a))
    }

    /// Matrix product.
    pub fn compose(&self, other: &Self) -> Self {
        Self {
            a: self.a * other.a + self.b * other.c,
            b: self.a * other.b + self.b * other.d,
            c: self.c * other.a + self.d * other.c,
            d: self.c * other.b + self.d * other.d,
            x_m: self.a * other.x_m + self.b * other.y_m + self.x_m,
            y_m: self.c * other.x_m + self.d * other.y_m + self.y_m,
        }
    }

    /// Matrix inverse. Readers see to it that there is one.
    pub fn inverse(&self) -> Self {
        let scale = 1.0 / self.determinant();
        let (a, b) = (self.d * scale, -self.b * scale);
        let (c, d) = (-self.c * scale, self.a * scale);
        Self {
            a,
            b,
            c,
            d,
            x_m: -(a * self.x_m + b * self.y_m),
            y_m: -(c * self.x_m + d * self.y_m),
        }
    }

    /// The pose of `other` seen from `self`.
    pub fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// 1 for a rotation, -1 for a mirror.
    pub fn determinant(&self) -> f64 {
        self.a * self.d - self.b * self.c
    }

    /// Whether this is a rotation as far as printed digits go.
    pub fn is_rigid(&self, tolerance: f64) -> bool {
        (self.determinant() - 1.0).abs() < tolerance
            && (self.a - self.d).abs() < tolerance
            && (self.b + self.c).abs() < tolerance
    }

    /// Distance of the two positions, m.
    pub fn distance_to_m(&self, other: &Self) -> f64 {
        let (dx, dy) = (self.x_m - other.x_m, self.y_m - other.y_m);
        (dx * dx + dy * dy).sqrt()
    }

    /// Length of the translation, m.
    pub fn distance_m(&self) -> f64 {
        (self.x_m * self.x_m + self.y_m * self.y_m).sqrt()
    }

    /// Angle of the rotation, rad, 0 to pi, from the matrix's trace as KITTI takes it.
    pub fn angle_rad(&self) -> f64 {
        elementary::acos((0.5 * (self.a + self.d)).clamp(-1.0, 1.0))
    }
}
