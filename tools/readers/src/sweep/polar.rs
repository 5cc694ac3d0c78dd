//! A sweep's points in polar form, and the beams that they fall into.

use crate::ros::Cloud;
use core::ops::Range;
use randt_geometry::elementary::{PI, atan2, wrap};
use randt_messages::MAX_BEAMS;

/// Points whose directions differ by less belong to one beam: a quarter of the finest step that a
/// table of 1,024 beams can have, and a thousand times the rounding of f32 coordinates.
pub(super) const SAME_BEAM_RAD: f64 = 0.25 * 2.0 * PI / MAX_BEAMS as f64;

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PolarPoint {
    /// Counter-clockwise from x, in (-pi, pi].
    pub azimuth_rad: f64,
    pub range_m: f64,
    pub intensity: f32,
}

/// The points of one turn in the order of the input.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Polar {
    /// The input's stamp; what it means is a setting.
    pub stamp_ns: i64,
    pub points: Vec<PolarPoint>,
    /// Points that the input had and this has not.
    pub dropped: u32,
}

/// Points of one beam: where they stand in the sweep, and their common direction.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cluster {
    pub points: Range<usize>,
    pub azimuth_rad: f64,
}

impl Polar {
    /// Converts a cloud; `mirrored` for a radar that hangs upside down. Also gives the number of
    /// points at range zero: they have no direction and are left out.
    pub fn from_cloud(cloud: &Cloud, mirrored: bool) -> (Self, u32) {
        let mut polar = Self {
            stamp_ns: cloud.header.stamp_ns,
            points: Vec::with_capacity(cloud.points.len()),
            dropped: cloud.not_finite,
        };
        let mut without_direction = 0;
        for point in &cloud.points {
            let y_m = if mirrored { -point.y_m } else { point.y_m };
            let range_m = (point.x_m * point.x_m + y_m * y_m).sqrt();
            if range_m > 0.0 && (range_m as f32).is_finite() {
                polar.points.push(PolarPoint {
                    azimuth_rad: atan2(y_m, point.x_m),
                    range_m,
                    intensity: point.intensity,
                });
            } else {
                without_direction += 1;
            }
        }
        polar.dropped += without_direction;
        (polar, without_direction)
    }
}

/// Groups neighbouring points of one direction.
pub(super) fn clusters(points: &[PolarPoint]) -> Vec<Cluster> {
    let mut clusters: Vec<Cluster> = Vec::new();
    let mut start = 0;
    while let Some(first) = points.get(start) {
        // Far points fix the direction best (f32 coordinates round by the same length near and
        // far), so the mean is weighted by range.
        let (mut sum, mut weight) = (0.0, 0.0);
        let mut end = start;
        while let Some(point) = points.get(end) {
            let offset = wrap(point.azimuth_rad - first.azimuth_rad);
            if offset.abs() > SAME_BEAM_RAD {
                break;
            }
            sum += point.range_m * offset;
            weight += point.range_m;
            end += 1;
        }
        clusters.push(Cluster {
            points: start..end,
            azimuth_rad: first.azimuth_rad + sum / weight,
        });
        start = end;
    }
    clusters
}
