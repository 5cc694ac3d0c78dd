//! Straights: the direction in which the robot drives, as the radar sees it.

use crate::estimate::{ESTIMATES_MIN, Estimate, PartialEstimate, mean};
use crate::motion::{Step, runs, turn, way_m};
use crate::{RadarPose, Span, Unobservable};
use nalgebra::Vector2;
use randt_geometry::{
    Pose2,
    elementary::{atan2, sin_cos, wrap},
};

/// Largest spread of the headings in a part of a straight, rad: 0.03 of noise, and an arc of 20 m.
const BEND_MAX_RAD: f64 = 0.12;
/// Slowest drive that counts, m/s: slower, a scan's noise is as large as its way.
const SPEED_MIN_M_S: f64 = 0.15;
/// A straight is cut into parts of this length, m: many enough to show their spread, and each so
/// long that slip and a scan's noise of a centimetre are half a degree.
const PART_MIN_M: f64 = 1.5;
const PART_MAX_M: f64 = 4.0;
/// All of it that is needed, m.
const PATH_MIN_M: f64 = 10.0;
/// Parts that go another way than most are neither forward nor backward, rad.
const ASIDE_RAD: f64 = 0.5;
/// What every straight shares, rad (0.06 degrees): simulated drives are off by as much on the
/// average.
const SYSTEMATIC_RAD: f64 = 0.001;

/// The mounting's yaw.
#[derive(Clone, Debug, PartialEq)]
pub struct MountingYaw {
    /// Radar in `base_link`, rad.
    pub yaw_rad: Estimate,
    /// What showed it.
    pub spans: Vec<Span>,
    /// Driven in them, m.
    pub path_m: f64,
}

/// Finds the yaw: of the robot's own point, which is the `pivot` of the radar's frame, or the
/// radar where it is not known.
pub(crate) fn mounting_yaw(
    poses: &[RadarPose],
    pivot: Option<Vector2<f64>>,
) -> Result<MountingYaw, Unobservable> {
    let moving = |_: &Step, b: &Step| b.speed_m_s > SPEED_MIN_M_S;
    let pivot = pivot.unwrap_or_default();
    let parts = runs(poses, moving).into_iter().flat_map(straights);
    let ways = parts.filter_map(|part| Some((way(part, pivot), Span::from_poses(part)?)));
    let ways: Vec<(Vector2<f64>, Span)> = ways.collect();
    let path_m: f64 = ways.iter().map(|(way, _)| way.norm()).sum();
    let refusal = Unobservable::Straight {
        chunks: ways.len(),
        needed: ESTIMATES_MIN,
        path_m,
        needed_m: PATH_MIN_M,
    };
    if ways.len() < ESTIMATES_MIN || path_m < PATH_MIN_M {
        return Err(refusal);
    }
    // Forward is where most of the path goes: the part that agrees with the most others.
    let agree = |a: &Vector2<f64>| -> f64 {
        let along = |(b, _): &(Vector2<f64>, Span)| a.dot(b) / a.norm().max(f64::MIN_POSITIVE);
        ways.iter().map(along).filter(|along| *along > 0.0).sum()
    };
    let forward = ways.iter().map(|(way, _)| way);
    let forward = forward.max_by(|a, b| agree(a).total_cmp(&agree(b)));
    let Some(forward) = forward.map(|way| atan2(way.y, way.x)) else {
        return Err(refusal);
    };
    let mut spans = Vec::new();
    let mut angles = Vec::new();
    for (way, span) in &ways {
        let aside = wrap(atan2(way.y, way.x) - forward);
        // Backward driving shows the same yaw.
        let aside = match aside.abs() > core::f64::consts::FRAC_PI_2 {
            true => wrap(aside + core::f64::consts::PI),
            false => aside,
        };
        if aside.abs() < ASIDE_RAD {
            spans.push(*span);
            angles.push(PartialEstimate {
                value: aside,
                weight: way.norm_squared(),
            });
        }
    }
    let Some(aside) = mean(&angles).filter(|_| angles.len() >= ESTIMATES_MIN) else {
        return Err(refusal);
    };
    Ok(MountingYaw {
        yaw_rad: Estimate {
            value: wrap(-(forward + aside.value)),
            ..aside
        }
        .with_systematic(SYSTEMATIC_RAD),
        spans: Span::joined(spans),
        path_m,
    })
}

/// Parts of a run that bend little, one behind the other.
fn straights(run: &[RadarPose]) -> Vec<&[RadarPose]> {
    let mut parts = Vec::new();
    let mut rest = run;
    while let Some(first) = rest.first() {
        let (mut path_m, mut left_rad, mut right_rad) = (0.0, 0.0f64, 0.0f64);
        let mut steps = 0;
        for (a, b) in rest.iter().zip(rest.iter().skip(1)) {
            let turned_rad = wrap(b.pose.yaw_rad - first.pose.yaw_rad);
            (left_rad, right_rad) = (left_rad.max(turned_rad), right_rad.min(turned_rad));
            if left_rad - right_rad > BEND_MAX_RAD || path_m > PART_MAX_M {
                break;
            }
            path_m += way_m(a, b);
            steps += 1;
        }
        let long = path_m >= PART_MIN_M;
        parts.extend(rest.get(..=steps).filter(|_| long));
        // The last pose of a part begins the next one.
        rest = rest.get(if long { steps } else { 1 }..).unwrap_or_default();
    }
    parts
}

/// The way of a point of the radar's frame, in the radar's frame as it turns along.
fn way(part: &[RadarPose], point: Vector2<f64>) -> Vector2<f64> {
    let step = |pair: &[RadarPose]| match pair {
        [a, b] => {
            let at = |pose: &Pose2| pose.transform(point);
            let middle = a.pose.yaw_rad + 0.5 * wrap(b.pose.yaw_rad - a.pose.yaw_rad);
            let (sin, cos) = sin_cos(middle);
            turn(at(&b.pose) - at(&a.pose), (cos, -sin))
        }
        _ => Vector2::zeros(),
    };
    part.windows(2).map(step).sum()
}
