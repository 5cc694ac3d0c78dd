//! Turns in place: the axis that the robot turns about, in the radar's frame.
//!
//! While the robot turns about its own axis, one point that moves with the radar stays where it
//! is. On arcs such a point exists too, but it lies on the other side when the robot turns the
//! other way: so one that stays for turns to the left and to the right is the robot's.

use crate::estimate::{Estimate, PartialEstimate, mean};
use crate::motion::{Step, cut, runs, turn, turned_rad};
use crate::{RadarPose, Span, Unobservable};
use nalgebra::Vector2;

/// Slowest turn that counts, rad/s: well above what odometry's yaw wavers.
const RATE_MIN_RAD_S: f64 = 0.15;
/// A turn is cut into parts of this angle, rad: it fixes an axis to a centimetre or two, and many
/// of them show their spread.
const PART_RAD: f64 = 1.0;
/// Parts whose axes are this near to each other turn about the same, m.
const SAME_AXIS_M: f64 = 0.1;
/// A point that moves more than this, root mean square, is no axis, m.
const STRAY_MAX_M: f64 = 0.05;
/// Farther from the radar no robot has its axis, m.
const DISTANCE_MAX_M: f64 = 3.0;
/// What is needed to the left and to the right, rad: each sense a half turn in all.
const TURN_MIN_RAD: f64 = core::f64::consts::PI;
/// What every turn shares, m: simulated drives are off by 2 mm on the average, a hundredth of
/// odometry's cells.
const SYSTEMATIC_M: f64 = 0.004;

/// The robot's axis, that is `base_link`'s origin, in the radar's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Pivot {
    /// Along the radar's x, m.
    pub x_m: Estimate,
    /// Along the radar's y, m.
    pub y_m: Estimate,
    /// What showed it.
    pub spans: Vec<Span>,
    /// Turned to the left and to the right, rad.
    pub turned_rad: [f64; 2],
}

impl Pivot {
    /// The point, m.
    pub(crate) fn point_m(&self) -> Vector2<f64> {
        Vector2::new(self.x_m.value, self.y_m.value)
    }
}

/// A part of a turn, and the point that stays in it.
#[derive(Clone, Copy, Debug)]
struct Turn {
    axis: Vector2<f64>,
    weight: f64,
    /// Positive to the left.
    turned_rad: f64,
    span: Span,
}

/// Finds the axis.
pub(crate) fn pivot(poses: &[RadarPose]) -> Result<Pivot, Unobservable> {
    let same_sense = |a: &Step, b: &Step| {
        a.rate_rad_s * b.rate_rad_s > 0.0 && b.rate_rad_s.abs() > RATE_MIN_RAD_S
    };
    let turns: Vec<Turn> = runs(poses, same_sense)
        .into_iter()
        .flat_map(|run| cut(run, turned_rad, PART_RAD))
        .filter_map(axis)
        .collect();
    let near = |centre: Vector2<f64>| {
        let turns = turns.iter();
        turns.filter(move |turn| (turn.axis - centre).norm() < SAME_AXIS_M)
    };
    let both = |centre: Vector2<f64>| {
        let sense = |left: bool| -> f64 {
            let turns = near(centre).filter(|turn| (turn.turned_rad > 0.0) == left);
            turns.map(|turn| turn.turned_rad.abs()).sum()
        };
        [sense(true), sense(false)]
    };
    let least = |centre: Vector2<f64>| {
        let [left, right] = both(centre);
        left.min(right)
    };
    let centres = turns.iter().map(|turn| turn.axis);
    let best = centres.max_by(|a, b| least(*a).total_cmp(&least(*b)));
    let estimate = |centre: Vector2<f64>| {
        let parts = |value: fn(&Turn) -> f64| -> Vec<PartialEstimate> {
            let part = |turn: &Turn| PartialEstimate {
                value: value(turn),
                weight: turn.weight,
            };
            near(centre).map(part).collect()
        };
        let x_m = mean(&parts(|turn| turn.axis.x))?;
        Some([x_m, mean(&parts(|turn| turn.axis.y))?])
    };
    // The mean of those around one of them, then of those around the mean.
    let first = best.and_then(estimate);
    let first = first.map(|[x, y]| Vector2::new(x.value, y.value));
    let turned_rad = first.map_or([0.0; 2], both);
    let enough = turned_rad.iter().all(|turned| *turned >= TURN_MIN_RAD);
    let first = first.filter(|_| enough);
    match first.and_then(|centre| Some((centre, estimate(centre)?))) {
        Some((centre, [x_m, y_m])) => Ok(Pivot {
            x_m: x_m.with_systematic(SYSTEMATIC_M),
            y_m: y_m.with_systematic(SYSTEMATIC_M),
            spans: Span::joined(near(centre).map(|turn| turn.span).collect()),
            turned_rad,
        }),
        None => Err(Unobservable::TurnsInPlace {
            left_deg: turned_rad[0].to_degrees(),
            right_deg: turned_rad[1].to_degrees(),
            needed_deg: TURN_MIN_RAD.to_degrees(),
        }),
    }
}

/// The point p of the radar's frame with x + R p as constant as can be. R - mean R is a turn and a
/// scale, so that the least squares have one weight for both coordinates.
fn axis(part: &[RadarPose]) -> Option<Turn> {
    let count = part.len() as f64;
    let direction = |pose: &RadarPose| {
        let (cos, sin) = pose.pose.cos_sin();
        Vector2::new(cos, sin)
    };
    let position = |pose: &RadarPose| pose.pose.translation();
    let mean_position = part.iter().map(position).sum::<Vector2<f64>>() / count;
    let mean_direction = part.iter().map(direction).sum::<Vector2<f64>>() / count;
    let mut sum = Vector2::zeros();
    let mut weight = 0.0;
    for pose in part {
        let r = direction(pose) - mean_direction;
        sum -= turn(position(pose) - mean_position, (r.x, -r.y));
        weight += r.norm_squared();
    }
    let axis = sum / weight;
    let stray = |pose: &RadarPose| {
        let r = direction(pose) - mean_direction;
        (position(pose) - mean_position + turn(axis, (r.x, r.y))).norm_squared()
    };
    let stray_m = (part.iter().map(stray).sum::<f64>() / count).sqrt();
    let turned_rad = part.windows(2).map(|pair| match pair {
        [a, b] => {
            turned_rad(a, b) * Step::between(a, b).map_or(0.0, |step| step.rate_rad_s.signum())
        }
        _ => 0.0,
    });
    let found = axis.norm() < DISTANCE_MAX_M && stray_m < STRAY_MAX_M;
    found.then_some(Turn {
        axis,
        weight,
        turned_rad: turned_rad.sum(),
        span: Span::from_poses(part)?,
    })
}
