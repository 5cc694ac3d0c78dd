//! A trajectory that is asked by stamp: where the robot stood then, and how far it had come.

use crate::pairs::{at, gap_max_ns};
use crate::{Trajectory, Transform};

/// A trajectory with the path up to each of its poses.
pub(crate) struct Timeline<'a> {
    trajectory: &'a Trajectory,
    path_m: Vec<f64>,
    gap_max_ns: i64,
}

/// A robot at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instant {
    /// Poses of two frames cannot be compared.
    pub frame: u64,
    /// Where it stood.
    pub transform: Transform,
    /// Path from the trajectory's begin, m.
    pub path_m: f64,
}

impl Instant {
    /// Distance of two positions, m; `None` where the frames differ.
    pub fn distance_m(&self, other: &Self) -> Option<f64> {
        let is_same = self.frame == other.frame;
        is_same.then(|| self.transform.distance_to_m(&other.transform))
    }
}

/// Error of the motion between two instants, each estimated and true; `None` across a change of
/// frame.
pub(crate) fn relative_error(
    from: (&Instant, &Instant),
    to: (&Instant, &Instant),
) -> Option<Transform> {
    let same = from.0.frame == to.0.frame && from.1.frame == to.1.frame;
    same.then(|| {
        let is = from.1.transform.between(&to.1.transform);
        is.between(&from.0.transform.between(&to.0.transform))
    })
}

impl<'a> Timeline<'a> {
    /// Of a trajectory; of one without stamps nothing is ever found.
    pub fn new(trajectory: &'a Trajectory) -> Self {
        Self {
            trajectory,
            path_m: trajectory.path_m(),
            gap_max_ns: gap_max_ns(trajectory),
        }
    }

    /// The robot at a stamp, interpolated; `None` outside, in gaps and between frames.
    pub fn at(&self, stamp_ns: i64) -> Option<Instant> {
        if !self.trajectory.is_stamped() {
            return None;
        }
        let poses = self.trajectory.poses();
        let (frame, transform) = at(poses, stamp_ns, self.gap_max_ns)?;
        let next = poses.partition_point(|pose| pose.stamp_ns <= stamp_ns);
        let before = next.saturating_sub(1);
        let last = poses.get(before).filter(|pose| pose.frame == frame);
        let step_m = last.map_or(0.0, |pose| transform.distance_to_m(&pose.transform));
        Some(Instant {
            frame,
            transform,
            path_m: self.path_m.get(before).copied().unwrap_or_default() + step_m,
        })
    }
}
