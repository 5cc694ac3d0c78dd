//! Which pose of the estimate belongs to which of the truth.

use crate::trajectory::TrajectoryPose;
use crate::{Error, Trajectory, Transform};

/// Stamps that are printed with four decimals or more meet within this.
const STAMP_TOLERANCE_NS: i64 = 100_000;
/// A gap of the estimate that is longer is not bridged: what happened inside is not known.
const GAP_MAX_NS: i64 = 1_000_000_000;
/// An estimate of keyframes has longer steps; gaps are what is longer than this many of its usual
/// ones.
const GAP_MAX_STEPS: i64 = 3;

/// Estimate and truth at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    /// Index of the truth's pose.
    pub index: usize,
    /// Counts the changes of frame, of either side: pairs of two frames cannot be compared.
    pub frame: usize,
    /// Where the robot was thought to be.
    pub estimate: Transform,
    /// Where it was.
    pub truth: Transform,
}

/// Every pose of the truth for which the estimate has one, at the same instant.
pub(crate) fn pair(estimate: &Trajectory, truth: &Trajectory) -> Result<Vec<Pair>, Error> {
    let poses = estimate.poses();
    if estimate.is_stamped() != truth.is_stamped() {
        let (stamped, unstamped) = match estimate.is_stamped() {
            true => ("estimate", "truth"),
            false => ("truth", "estimate"),
        };
        return Err(Error::MixedFormats { stamped, unstamped });
    }
    if !estimate.is_stamped() && poses.len() != truth.poses().len() {
        return Err(Error::RowCounts {
            estimate: poses.len(),
            truth: truth.poses().len(),
        });
    }
    let gap_max_ns = gap_max_ns(estimate);
    let mut pairs = Vec::new();
    let mut frames = None;
    let mut frame = 0;
    for (index, there) in truth.poses().iter().enumerate() {
        let here = match estimate.is_stamped() {
            true => at(poses, there.stamp_ns, gap_max_ns),
            false => poses.get(index).map(|pose| (pose.frame, pose.transform)),
        };
        let Some((estimate_frame, estimate)) = here else {
            continue;
        };
        let now = (estimate_frame, there.frame);
        if frames.is_some_and(|before| before != now) {
            frame += 1;
        }
        frames = Some(now);
        pairs.push(Pair {
            index,
            frame,
            estimate,
            truth: there.transform,
        });
    }
    Ok(pairs)
}

/// The longest step that is bridged.
pub(crate) fn gap_max_ns(estimate: &Trajectory) -> i64 {
    let pairs = estimate.poses().iter().zip(estimate.poses().iter().skip(1));
    let pairs = pairs.filter(|(a, b)| a.frame == b.frame);
    let steps_ns = pairs.map(|(a, b)| b.stamp_ns.saturating_sub(a.stamp_ns));
    let mut steps_ns: Vec<i64> = steps_ns.collect();
    steps_ns.sort_unstable();
    let usual_ns = steps_ns.get(steps_ns.len() / 2).copied().unwrap_or(0);
    GAP_MAX_NS.max(usual_ns.saturating_mul(GAP_MAX_STEPS))
}

/// Frame and pose at an instant; `None` outside the poses, in their gaps and between their frames.
pub(crate) fn at(
    poses: &[TrajectoryPose],
    stamp_ns: i64,
    gap_max_ns: i64,
) -> Option<(u64, Transform)> {
    let next = poses.partition_point(|pose| pose.stamp_ns <= stamp_ns);
    let before = next.checked_sub(1).and_then(|index| poses.get(index));
    let after = poses.get(next);
    let close = |pose: &&TrajectoryPose| {
        pose.stamp_ns.saturating_sub(stamp_ns).saturating_abs() <= STAMP_TOLERANCE_NS
    };
    if let Some(same) = before.filter(|pose| pose.stamp_ns == stamp_ns) {
        return Some((same.frame, same.transform));
    }
    if let (Some(a), Some(b)) = (before, after) {
        let step_ns = b.stamp_ns.saturating_sub(a.stamp_ns);
        if a.frame == b.frame && step_ns <= gap_max_ns {
            let fraction = stamp_ns.saturating_sub(a.stamp_ns) as f64 / step_ns as f64;
            let (from, to) = (a.transform.pose(), b.transform.pose());
            return Some((a.frame, from.interpolate(&to, fraction).into()));
        }
    }
    let nearest = before.filter(close).or(after.filter(close))?;
    Some((nearest.frame, nearest.transform))
}
