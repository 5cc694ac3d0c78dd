//! The radar in `base_link`: yaw from straights, lever arm from turns in place.
//!
//! `base_link` is the point that stays where it is in turns in place, and its x axis the way that straights go.

use crate::estimate::Estimate;
use crate::lever::{Pivot, pivot};
use crate::motion::turn;
use crate::yaw::{Heading, heading};
use crate::{RadarPose, Unshown};
use nalgebra::Vector2;
use randt_geometry::elementary::sin_cos;

/// Position of the radar in `base_link`.
#[derive(Clone, Debug, PartialEq)]
pub struct Lever {
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
    pub heading: Result<Heading, Unshown>,
    /// The lever arm.
    pub lever: Result<Lever, Unshown>,
}

/// Estimates it from the radar's own path.
pub fn mounting(poses: &[RadarPose]) -> Mounting {
    let pivot = pivot(poses);
    let point = pivot
        .as_ref()
        .ok()
        .map(|p| Vector2::new(p.x_m.value, p.y_m.value));
    let heading = heading(poses, point);
    let lever = pivot.and_then(|pivot| match &heading {
        Ok(heading) => Ok(lever(pivot, heading.yaw_rad)),
        Err(_) => Err(Unshown::Direction {
            distance_m: Vector2::new(pivot.x_m.value, pivot.y_m.value).norm(),
        }),
    });
    Mounting { heading, lever }
}

/// The robot's axis in the radar's frame becomes the radar in the robot's: turned by the yaw, and the other way.
fn lever(pivot: Pivot, yaw_rad: Estimate) -> Lever {
    let (sin, cos) = sin_cos(yaw_rad.value);
    let at = -turn(Vector2::new(pivot.x_m.value, pivot.y_m.value), (cos, sin));
    let sigma = |by_x: f64, by_y: f64, by_yaw: f64| {
        let terms = [
            by_x * pivot.x_m.sigma,
            by_y * pivot.y_m.sigma,
            by_yaw * yaw_rad.sigma,
        ];
        terms.iter().map(|term| term * term).sum::<f64>().sqrt()
    };
    Lever {
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
