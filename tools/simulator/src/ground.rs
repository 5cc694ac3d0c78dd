//! The ground: smooth relief under vertical walls, and how a robot stands on it.

use crate::MotionState;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use randt_geometry::elementary::{atan2, sin_cos};

/// Standard gravity.
const GRAVITY_M_S2: f64 = 9.806_65;

/// One piece of relief. Heights add up; each is smooth to its second derivative, so that a robot's
/// rates never jump.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Relief {
    /// A plane through the origin's height.
    Slope {
        /// Rise per metre towards x and y.
        grade: Vector2<f64>,
    },
    /// A round hill; a hollow where the height is negative.
    Hill {
        /// Its top.
        centre_m: Vector2<f64>,
        /// Where it ends.
        radius_m: f64,
        /// Height of the top.
        height_m: f64,
    },
    /// Level up to one line across, rising to another, level from there on.
    Ramp {
        /// Its foot; the lines stand across the way from foot to head.
        from_m: Vector2<f64>,
        /// Its head.
        to_m: Vector2<f64>,
        /// Rise from foot to head.
        height_m: f64,
    },
}

/// Height, gradient and curvature of the ground at one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundPoint {
    /// Height.
    pub height_m: f64,
    /// Rise per metre towards x and y.
    pub gradient: Vector2<f64>,
    /// Change of the gradient, 1/m.
    pub curvature: Matrix2<f64>,
}

impl Relief {
    /// Its share of the ground at a point.
    pub fn at(&self, point_m: Vector2<f64>) -> GroundPoint {
        match *self {
            Self::Slope { grade } => GroundPoint {
                height_m: grade.dot(&point_m),
                gradient: grade,
                curvature: Matrix2::zeros(),
            },
            Self::Hill {
                centre_m,
                radius_m,
                height_m,
            } => {
                // h q^3 with q = 1 - (r / R)^2.
                let offset = (point_m - centre_m) / radius_m;
                let q = (1.0 - offset.norm_squared()).max(0.0);
                let scale = -6.0 * height_m * q / radius_m;
                GroundPoint {
                    height_m: height_m * q * q * q,
                    gradient: offset * (scale * q),
                    curvature: (Matrix2::identity() * q - offset * offset.transpose() * 4.0)
                        * (scale / radius_m),
                }
            }
            Self::Ramp {
                from_m,
                to_m,
                height_m,
            } => {
                // h s^3 (6 s^2 - 15 s + 10): flat to the second derivative at both ends.
                let along = (to_m - from_m) / (to_m - from_m).norm_squared();
                let s = along.dot(&(point_m - from_m)).clamp(0.0, 1.0);
                let (rest, rise) = (1.0 - s, 30.0 * height_m);
                GroundPoint {
                    height_m: height_m * s * s * s * (s * (6.0 * s - 15.0) + 10.0),
                    gradient: along * (rise * s * s * rest * rest),
                    curvature: along
                        * along.transpose()
                        * (2.0 * rise * s * rest * (1.0 - 2.0 * s)),
                }
            }
        }
    }

    /// The steepest grade that it has anywhere.
    pub fn grade_max(&self) -> f64 {
        match *self {
            Self::Slope { grade } => grade.norm(),
            // At r = R / sqrt(5): 6 (4/5)^2 / sqrt(5).
            Self::Hill {
                radius_m, height_m, ..
            } => 1.717_3 * height_m.abs() / radius_m,
            // Half way up: 30 / 16.
            Self::Ramp {
                from_m,
                to_m,
                height_m,
            } => 1.875 * height_m.abs() / (to_m - from_m).norm(),
        }
    }
}

/// All relief of a world; level where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ground {
    /// Its pieces.
    pub reliefs: Vec<Relief>,
}

impl Ground {
    /// Height, gradient and curvature at a point.
    pub fn at(&self, point_m: Vector2<f64>) -> GroundPoint {
        let level = GroundPoint::default();
        self.reliefs.iter().fold(level, |sum, relief| {
            let ground = relief.at(point_m);
            GroundPoint {
                height_m: sum.height_m + ground.height_m,
                gradient: sum.gradient + ground.gradient,
                curvature: sum.curvature + ground.curvature,
            }
        })
    }

    /// A robot's attitude here. Its pose and velocity are those of its shadow in the level plane.
    pub fn attitude(&self, state: &MotionState) -> RobotAttitude {
        let [x, y, yaw] = state.pose;
        let [forward, left, turn] = state.velocity;
        let [onward, sideward, _] = state.acceleration;
        if self.reliefs.is_empty() {
            return RobotAttitude {
                tilt: None,
                rate_rad_s: [0.0, 0.0, turn],
                force_m_s2: [onward, sideward, GRAVITY_M_S2],
            };
        }
        let ground = self.at(Vector2::new(x, y));
        // Into the level frame of the robot's heading, where it moves with `velocity`.
        let (sin, cos) = sin_cos(yaw);
        let heading = Matrix2::new(cos, -sin, sin, cos);
        let gradient = heading.transpose() * ground.gradient;
        let curvature = heading.transpose() * ground.curvature * heading;
        let velocity = Vector2::new(forward, left);
        // As the ground under a robot of fixed heading changes.
        let change = curvature * velocity;

        let lengthwise = Vector3::new(1.0, 0.0, gradient.x);
        let up = Vector3::new(-gradient.x, -gradient.y, 1.0);
        let (length, height) = (lengthwise.norm(), up.norm());
        let (ahead, up) = (lengthwise / length, up / height);
        let across = up.cross(&ahead);
        // d ahead / dt and d up / dt, seen from the world, both before they are made unit vectors.
        let ahead_change = Vector3::new(0.0, turn, change.x + turn * gradient.y) / length;
        let up_change = Vector3::new(-change.x, -change.y, 0.0) / height;
        let climb = velocity.dot(&change) + gradient.dot(&Vector2::new(onward, sideward));
        let force = Vector3::new(onward, sideward, GRAVITY_M_S2 + climb);
        RobotAttitude {
            tilt: Some(Matrix3::from_columns(&[ahead, across, up])),
            rate_rad_s: [
                -up_change.dot(&across),
                up_change.dot(&ahead),
                ahead_change.dot(&across),
            ],
            force_m_s2: [force.dot(&ahead), force.dot(&across), force.dot(&up)],
        }
    }
}

/// A robot's attitude: tilted as the ground is, with what its IMU measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotAttitude {
    // The body in the level frame of its heading; none on level ground, which costs no bits.
    tilt: Option<Matrix3<f64>>,
    /// Angular rate in the body.
    pub rate_rad_s: [f64; 3],
    /// Acceleration against free fall, in the body.
    pub force_m_s2: [f64; 3],
}

impl RobotAttitude {
    /// Whether the ground has no relief at all; then every number is the same bits as without one.
    pub fn is_level(&self) -> bool {
        self.tilt.is_none()
    }

    /// A point of the body's x-y plane, in the level frame.
    pub fn level(&self, point: Vector2<f64>) -> Vector2<f64> {
        let tilted = |tilt: Matrix3<f64>| (tilt * Vector3::new(point.x, point.y, 0.0)).xy();
        self.tilt.map_or(point, tilted)
    }

    /// A direction in the body's x-y plane: its azimuth in the level frame, and cosine and sine of
    /// its elevation.
    pub fn ray(&self, azimuth_rad: f64) -> (f64, f64, f64) {
        let Some(tilt) = self.tilt else {
            return (azimuth_rad, 1.0, 0.0);
        };
        let (sin, cos) = sin_cos(azimuth_rad);
        let ray = tilt * Vector3::new(cos, sin, 0.0);
        (atan2(ray.y, ray.x), ray.xy().norm(), ray.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Drive, MotionProfile, World};
    use proptest::prelude::*;
    use randt_geometry::Quaternion;

    fn hilly() -> Ground {
        Ground {
            reliefs: vec![
                Relief::Slope {
                    grade: Vector2::new(0.03, -0.02),
                },
                Relief::Hill {
                    centre_m: Vector2::new(3.0, 2.0),
                    radius_m: 9.0,
                    height_m: 0.6,
                },
                Relief::Ramp {
                    from_m: Vector2::new(0.0, 1.0),
                    to_m: Vector2::new(6.0, -4.0),
                    height_m: -0.5,
                },
            ],
        }
    }

    proptest! {
        #[test]
        fn gradient_and_curvature_are_the_heights_derivatives(x in -9.0..9.0, y in -9.0..9.0) {
            let (ground, h) = (hilly(), 1e-4);
            let at = |dx: f64, dy: f64| ground.at(Vector2::new(x + dx, y + dy));
            let [right, left, above, below] = [at(h, 0.0), at(-h, 0.0), at(0.0, h), at(0.0, -h)];
            let here = at(0.0, 0.0);
            let gradient = Vector2::new(right.height_m - left.height_m, above.height_m - below.height_m);
            prop_assert!((gradient / (2.0 * h) - here.gradient).norm() < 1e-6);
            let curvature = Matrix2::from_columns(&[right.gradient - left.gradient, above.gradient - below.gradient]);
            prop_assert!((curvature / (2.0 * h) - here.curvature).norm() < 1e-4);
            let steepest: f64 = ground.reliefs.iter().map(Relief::grade_max).sum();
            prop_assert!(here.gradient.norm() <= steepest + 1e-9);
        }
    }

    #[test]
    fn rates_and_forces_are_the_motions_derivatives() {
        let ground = hilly();
        let route = [[0.0, 0.0], [7.0, 0.0], [7.0, 6.0], [0.0, 6.0]];
        let world = World {
            route_m: route.map(Vector2::from).to_vec(),
            ..World::default()
        };
        let mut drive = Drive::new(&world, MotionProfile::default(), 3);
        // The middle between two decisions of the driver, where everything is smooth.
        let step_ns = 1_000_000;
        for index in 60..900_i64 {
            let mut at = |steps: i64| {
                let state = drive.at(index * 50_000_000 + 5_000_000 + steps * step_ns);
                let [x, y, yaw] = state.pose;
                let point = ground.at(Vector2::new(x, y));
                let (sin, cos) = sin_cos(yaw);
                // Roll and pitch from the gradient by another way: pitch of the x axis, roll of
                // the normal.
                let along = cos * point.gradient.x + sin * point.gradient.y;
                let left = cos * point.gradient.y - sin * point.gradient.x;
                let roll = atan2(left, (1.0 + along * along).sqrt());
                let turned = Quaternion::from_roll_pitch_yaw(roll, -atan2(along, 1.0), yaw);
                (
                    ground.attitude(&state),
                    turned,
                    Vector3::new(x, y, point.height_m),
                )
            };
            let [before, now, after] = [at(-2), at(0), at(2)];
            let dt_s = 4.0 * step_ns as f64 * 1e-9;
            let turn = before.1.conjugate().multiply(&after.1);
            let rate = Vector3::new(turn.x, turn.y, turn.z) * (2.0 / dt_s);
            assert!(
                (rate - Vector3::from(now.0.rate_rad_s)).norm() < 1e-4,
                "{rate}"
            );
            let fall = (after.2 - now.2 * 2.0 + before.2) * (4.0 / (dt_s * dt_s));
            let force = now.1.conjugate().rotate(fall + Vector3::z() * GRAVITY_M_S2);
            assert!(
                (force - Vector3::from(now.0.force_m_s2)).norm() < 1e-3,
                "{force}"
            );
            // A beam to the left and its elevation.
            let (azimuth, cos, sin) = now.0.ray(1.2);
            let (sin_beam, cos_beam) = sin_cos(1.2);
            let beam = now.1.rotate(Vector3::new(cos_beam, sin_beam, 0.0));
            let yaw = now.1.roll_pitch_yaw().2;
            let (sin_level, cos_level) = sin_cos(azimuth + yaw);
            assert!((beam - Vector3::new(cos * cos_level, cos * sin_level, sin)).norm() < 1e-9);
        }
    }
}
