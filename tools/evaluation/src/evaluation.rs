//! All errors of one estimate against one truth.

use crate::absolute::Alignment;
use crate::pairs::{gap_max_ns, pair};
use crate::trajectory::TrajectoryPose;
use crate::{Error, Trajectory, absolute, relative};

/// How exact an estimate is. An error that is not defined for it (too short, nothing in common) is
/// `None`.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// Absolute trajectory error: RMSE of positions after rigid alignment, m; every frame by
    /// itself, pooled.
    pub ate_rmse_m: Option<f64>,
    /// Mean translation error of the motion between neighbouring poses of the truth, m.
    pub rpe_translation_mean_m: Option<f64>,
    /// Mean rotation error of the same, degrees.
    pub rpe_rotation_mean_deg: Option<f64>,
    /// KITTI drift in translation, percent of the path.
    pub kitti_translation_percent: Option<f64>,
    /// KITTI drift in rotation, degrees per 100 m.
    pub kitti_rotation_deg_per_100m: Option<f64>,
    /// Share of the truth's poses for which the estimate has one, 0..1.
    pub coverage: f64,
    /// Poses of the truth.
    pub truth_poses: usize,
    /// Of those, poses for which the estimate has one.
    pub covered_poses: usize,
    /// Frames among the covered poses; more than one where odometry began anew.
    pub frames: usize,
    /// Length of the truth's path, m.
    pub path_m: f64,
    /// The longest step of the estimate that was bridged, s.
    pub gap_max_s: f64,
}

/// Compares an estimate with the truth, at the truth's instants.
///
/// The estimate is interpolated where its stamps are others, never across a gap or a change of
/// frame. Rows without stamps belong together one by one.
pub fn evaluate(estimate: &Trajectory, truth: &Trajectory) -> Result<Evaluation, Error> {
    let pairs = pair(estimate, truth)?;
    let path_m = truth.path_m();
    let step = relative::per_step(&pairs);
    let drift = relative::drift(&pairs, &path_m);
    let truth_poses = truth.poses().len();
    Ok(Evaluation {
        ate_rmse_m: absolute::ate_rmse_m(&pairs),
        rpe_translation_mean_m: step.map(|mean| mean.translation),
        rpe_rotation_mean_deg: step.map(|mean| mean.rotation.to_degrees()),
        kitti_translation_percent: drift.map(|mean| 100.0 * mean.translation),
        kitti_rotation_deg_per_100m: drift.map(|mean| 100.0 * mean.rotation.to_degrees()),
        coverage: pairs.len() as f64 / truth_poses.max(1) as f64,
        truth_poses,
        covered_poses: pairs.len(),
        frames: pairs.last().map_or(0, |pair| pair.frame + 1),
        path_m: path_m.last().copied().unwrap_or_default(),
        gap_max_s: gap_max_ns(estimate) as f64 * 1e-9,
    })
}

/// The truth's positions as they lie in the estimate's frame after rigid alignment, for the
/// picture, m.
///
/// Where the estimate has several frames the first one is meant. Empty where nothing belongs
/// together.
pub fn truth_on_estimate(
    estimate: &Trajectory,
    truth: &Trajectory,
) -> Result<Vec<[f64; 2]>, Error> {
    let pairs = pair(estimate, truth)?;
    let Some(first) = pairs.chunk_by(|a, b| a.frame == b.frame).next() else {
        return Ok(Vec::new());
    };
    let alignment = Alignment::from_pairs(first);
    let positions = truth.poses().iter().map(TrajectoryPose::position_m);
    Ok(positions
        .map(|at| alignment.truth_on_estimate(at))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Pose2;

    /// Quarter-second steps of a metre around a circle of 50 m, seen from `seen_from`.
    fn circle(
        count: usize,
        frame: impl Fn(usize) -> u64,
        seen_from: impl Fn(usize) -> Pose2,
    ) -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        let mut pose = Pose2::IDENTITY;
        for step in 0..count {
            let seen = seen_from(step).between(&pose);
            trajectory.push(step as i64 * 250_000_000, frame(step), seen);
            pose = pose.compose(&Pose2::exp([1.0, 0.0, 0.02].into()));
        }
        trajectory
    }

    fn truth(count: usize) -> Trajectory {
        circle(count, |_| 0, |_| Pose2::IDENTITY)
    }

    #[test]
    fn where_the_frame_stands_is_no_error() {
        let estimate = circle(500, |_| 0, |_| Pose2::new(30.0, -7.0, 2.0));
        let evaluation = evaluate(&estimate, &truth(500)).unwrap();
        assert!(evaluation.ate_rmse_m.unwrap() < 1e-9);
        assert!(evaluation.rpe_translation_mean_m.unwrap() < 1e-9);
        assert!(evaluation.kitti_translation_percent.unwrap() < 1e-9);
        assert!(evaluation.kitti_rotation_deg_per_100m.unwrap() < 1e-4);
        assert_eq!(evaluation.coverage, 1.0);
        assert!((evaluation.path_m - 499.0).abs() < 0.1);

        let laid = truth_on_estimate(&estimate, &truth(500)).unwrap();
        for (laid, pose) in laid.iter().zip(estimate.poses()) {
            assert!((laid[0] - pose.transform.x_m).abs() < 1e-9);
            assert!((laid[1] - pose.transform.y_m).abs() < 1e-9);
        }
    }

    #[test]
    fn a_mirrored_estimate_is_an_error() {
        let mut estimate = Trajectory::stamped();
        for pose in truth(300).poses() {
            let p = pose.transform.pose();
            estimate.push(pose.stamp_ns, 0, Pose2::new(p.x_m, -p.y_m, -p.yaw_rad));
        }
        let evaluation = evaluate(&estimate, &truth(300)).unwrap();
        assert!(evaluation.ate_rmse_m.unwrap() > 5.0);
        assert!(evaluation.rpe_rotation_mean_deg.unwrap() > 2.0);
    }

    #[test]
    fn other_stamps_are_interpolated() {
        let mut truth = Trajectory::stamped();
        let mut estimate = Trajectory::stamped();
        for step in 0..100_i64 {
            let pose = |at: f64| Pose2::new(at, 0.0, 3.0 + 0.01 * at);
            estimate.push(step * 1_000_000_000, 0, pose(step as f64));
            truth.push(
                step * 1_000_000_000 + 300_000_000,
                0,
                pose(step as f64 + 0.3),
            );
        }
        let evaluation = evaluate(&estimate, &truth).unwrap();
        assert!(evaluation.ate_rmse_m.unwrap() < 1e-9);
        assert!(evaluation.rpe_rotation_mean_deg.unwrap() < 1e-5);
        assert_eq!(evaluation.covered_poses, 99);
    }

    #[test]
    fn two_frames_are_never_spliced() {
        let second = Pose2::new(-40.0, 12.0, -2.0);
        let frame = |step: usize| u64::from(step >= 250);
        let seen_from = |step: usize| if step < 250 { Pose2::IDENTITY } else { second };
        let evaluation = evaluate(&circle(500, frame, seen_from), &truth(500)).unwrap();
        assert_eq!(evaluation.frames, 2);
        assert!(evaluation.ate_rmse_m.unwrap() < 1e-9);
        assert!(evaluation.rpe_translation_mean_m.unwrap() < 1e-9);
        assert!(evaluation.kitti_translation_percent.unwrap() < 1e-9);

        // Said to be one frame, the jump counts.
        let evaluation = evaluate(&circle(500, |_| 0, seen_from), &truth(500)).unwrap();
        assert!(evaluation.ate_rmse_m.unwrap() > 1.0);
        assert!(evaluation.rpe_translation_mean_m.unwrap() > 0.01);

        // Between the frames nothing is interpolated.
        let mut shifted = Trajectory::stamped();
        for pose in truth(500).poses() {
            shifted.push(pose.stamp_ns + 100_000_000, 0, pose.transform.pose());
        }
        let evaluation = evaluate(&circle(500, frame, seen_from), &shifted).unwrap();
        assert_eq!(evaluation.covered_poses, 498);
    }

    #[test]
    fn gaps_are_not_bridged_and_lower_the_coverage() {
        let mut estimate = Trajectory::stamped();
        for (index, pose) in truth(400).poses().iter().enumerate() {
            if !(100..200).contains(&index) {
                estimate.push(pose.stamp_ns, 0, pose.transform.pose());
            }
        }
        let evaluation = evaluate(&estimate, &truth(400)).unwrap();
        assert_eq!(evaluation.coverage, 0.75);
        assert!(evaluation.ate_rmse_m.unwrap() < 1e-9);
    }

    #[test]
    fn what_is_not_defined_is_none() {
        let evaluation = evaluate(&truth(50), &truth(50)).unwrap();
        assert_eq!(evaluation.kitti_translation_percent, None);
        assert_eq!(evaluation.kitti_rotation_deg_per_100m, None);
        assert!(evaluation.ate_rmse_m.is_some());

        let mut late = Trajectory::stamped();
        late.push(1_000_000_000_000, 0, Pose2::IDENTITY);
        let evaluation = evaluate(&late, &truth(50)).unwrap();
        assert_eq!(evaluation.coverage, 0.0);
        assert_eq!(evaluation.ate_rmse_m, None);
        assert_eq!(evaluation.rpe_translation_mean_m, None);
        assert_eq!(evaluate(&truth(1), &truth(1)).unwrap().ate_rmse_m, None);
    }

    #[test]
    fn standing_still_is_exact() {
        let mut still = Trajectory::stamped();
        (0..10).for_each(|step| still.push(step * 100_000_000, 0, Pose2::IDENTITY));
        let evaluation = evaluate(&still, &still).unwrap();
        assert_eq!(evaluation.ate_rmse_m, Some(0.0));
    }

    #[test]
    fn rows_without_stamps_go_one_by_one_or_not_at_all() {
        let rows = |count: usize| {
            let mut trajectory = Trajectory::unstamped();
            (0..count).for_each(|n| trajectory.push(0, 0, Pose2::new(n as f64, 0.0, 0.0)));
            trajectory
        };
        assert_eq!(evaluate(&rows(5), &rows(5)).unwrap().coverage, 1.0);
        assert!(matches!(
            evaluate(&rows(5), &rows(6)),
            Err(Error::RowCounts {
                estimate: 5,
                truth: 6
            })
        ));
        let error = evaluate(&rows(5), &truth(5)).unwrap_err().to_string();
        assert!(
            error.starts_with("the truth has stamps (TUM) and the estimate has none"),
            "{error}"
        );
    }
}
