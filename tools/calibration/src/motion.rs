//! The radar's own path, and the stretches of it in which a robot drives straight or turns.

use nalgebra::Vector2;
use randt_geometry::{Pose2, elementary::wrap};

/// Where the radar was at the end of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarPose {
    /// The sweep's end by the radar's stamps, ns.
    pub stamp_ns: i64,
    /// Poses of different frames have nothing to do with each other.
    pub frame: u64,
    /// The radar in that frame.
    pub pose: Pose2,
    /// Whether the scan fixed the position in every direction; the yaw it fixes always.
    pub fixed: bool,
}

/// A stretch of the drive by the radar's stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Its begin, ns.
    pub begin_ns: i64,
    /// Its end, ns.
    pub end_ns: i64,
}

/// Missing sweeps end a stretch, ns.
const GAP_MAX_NS: i64 = 1_000_000_000;

impl Span {
    /// From the first pose to the last one.
    pub(crate) fn from_poses(poses: &[RadarPose]) -> Option<Self> {
        Some(Self {
            begin_ns: poses.first()?.stamp_ns,
            end_ns: poses.last()?.stamp_ns,
        })
    }

    /// Spans in order, those that touch made one.
    pub(crate) fn joined(mut spans: Vec<Self>) -> Vec<Self> {
        spans.sort_by_key(|span| span.begin_ns);
        let mut joined: Vec<Self> = Vec::new();
        for span in spans {
            match joined.last_mut() {
                Some(last) if span.begin_ns <= last.end_ns => {
                    last.end_ns = last.end_ns.max(span.end_ns)
                }
                _ => joined.push(span),
            }
        }
        joined
    }
}

/// Motion from one pose to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub speed_m_s: f64,
    pub rate_rad_s: f64,
    fixed: bool,
}

impl Step {
    /// `None` where the two do not belong together.
    pub fn between(a: &RadarPose, b: &RadarPose) -> Option<Self> {
        let dt_ns = b.stamp_ns - a.stamp_ns;
        if a.frame != b.frame || dt_ns <= 0 || dt_ns > GAP_MAX_NS {
            return None;
        }
        let dt_s = dt_ns as f64 * 1e-9;
        Some(Self {
            speed_m_s: (b.pose.translation() - a.pose.translation()).norm() / dt_s,
            rate_rad_s: wrap(b.pose.yaw_rad - a.pose.yaw_rad) / dt_s,
            fixed: a.fixed && b.fixed,
        })
    }
}

/// The longest stretches whose steps all are `like` their first one.
pub(crate) fn runs(poses: &[RadarPose], like: impl Fn(&Step, &Step) -> bool) -> Vec<&[RadarPose]> {
    let mut runs = Vec::new();
    let mut begin = 0;
    let mut first: Option<Step> = None;
    for (i, pair) in poses.windows(2).enumerate() {
        let step = match pair {
            [a, b] => Step::between(a, b).filter(|step| step.fixed),
            _ => None,
        };
        let goes_on = matches!((&first, &step), (Some(first), Some(step)) if like(first, step));
        if !goes_on {
            if first.is_some() {
                runs.extend(poses.get(begin..=i));
            }
            begin = i;
            first = step.filter(|step| like(step, step));
        }
    }
    if first.is_some() {
        runs.extend(poses.get(begin..));
    }
    runs
}

/// Cuts a stretch into parts as soon as each has `enough`; what is left at the end belongs to
/// none.
pub(crate) fn cut(
    run: &[RadarPose],
    enough: impl Fn(&RadarPose, &RadarPose) -> f64,
    size: f64,
) -> Vec<&[RadarPose]> {
    let mut parts = Vec::new();
    let (mut begin, mut sum) = (0, 0.0);
    for (i, pair) in run.windows(2).enumerate() {
        if let [a, b] = pair {
            sum += enough(a, b);
        }
        if sum >= size {
            parts.extend(run.get(begin..=i + 1));
            (begin, sum) = (i + 1, 0.0);
        }
    }
    parts
}

/// Angle turned from one pose to the next, either way, rad.
pub(crate) fn turned_rad(a: &RadarPose, b: &RadarPose) -> f64 {
    wrap(b.pose.yaw_rad - a.pose.yaw_rad).abs()
}

/// Way from one pose to the next, m.
pub(crate) fn way_m(a: &RadarPose, b: &RadarPose) -> f64 {
    (b.pose.translation() - a.pose.translation()).norm()
}

/// A vector turned by an angle given as its cosine and sine.
pub(crate) fn turn(v: Vector2<f64>, (cos, sin): (f64, f64)) -> Vector2<f64> {
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}
