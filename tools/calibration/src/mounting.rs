//! The radar in `base_link`: yaw from straights, lever arm from turns in place.
//!
//! `base_link` is the point that stays where it is in turns in place, and its x axis the way that
//! straights go.

use crate::estimate::Estimate;
use crate::motion::turn;
use crate::pivot::{Pivot, pivot};
use crate::yaw::{MountingYaw, mounting_yaw};
use crate::{RadarPose, Unobservable};
use randt_geometry::elementary::sin_cos;

/// Position of the radar in `base_link`.
#[derive(Clone, Debug, PartialEq)]
pub struct LeverArm {
    /// Forward, m.
    pub x_m: Estimate,
    /// Left, m.
    pub y_m: Estimate,
    /// The turns that showed it.
    pub pivot: Pivot,
}

/// What a drive shows of the mounting, each figure or why not.
#[derive(Clone, Debug, PartialEq)]
pub struct Mounting {
    /// The yaw.
    pub yaw: Result<MountingYaw, Unobservable>,
    /// The lever arm.
    pub lever_arm: Result<LeverArm, Unobservable>,
}

/// Estimates it from the radar's own path.
pub fn mounting(poses: &[RadarPose]) -> Mounting {
    let pivot = pivot(poses);
    let point = pivot.as_ref().ok().map(Pivot::point_m);
    let yaw = mounting_yaw(poses, point);
    let lever_arm = pivot.and_then(|pivot| match &yaw {
        Ok(yaw) => Ok(lever_arm(pivot, yaw.yaw_rad)),
        Err(_) => Err(Unobservable::Direction {
            distance_m: pivot.point_m().norm(),
        }),
    });
    Mounting { yaw, lever_arm }
}

/// The robot's axis in the radar's frame becomes the radar in the robot's: turned by the yaw, and
/// the other way.
fn lever_arm(pivot: Pivot, yaw_rad: Estimate) -> LeverArm {
    let (sin, cos) = sin_cos(yaw_rad.value);
    let at = -turn(pivot.point_m(), (cos, sin));
    let sigma = |by_x: f64, by_y: f64, by_yaw: f64| {
        let terms = [
            by_x * pivot.x_m.sigma,
            by_y * pivot.y_m.sigma,
            by_yaw * yaw_rad.sigma,
        ];
        terms.iter().map(|term| term * term).sum::<f64>().sqrt()
    };
    LeverArm {
        x_m: Estimate {
            value: at.x,
            sigma: sigma(cos, sin, at.y),
        },
        y_m: Estimate {
            value: at.y,
            sigma: sigma(sin, cos, at.x),
        },
        pivot,
    }
}
