//! Loops against the truth: which are false, and how many of the revisits were recognised.

use crate::timeline::{Instant, Timeline};
use crate::{Error, Trajectory};
use randt_geometry::Pose2;

/// An edge of the graph that says where one instant's pose is, seen from an older one's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopEdge {
    /// Stamp of the older pose.
    pub from_ns: i64,
    /// Stamp of the newer pose.
    pub to_ns: i64,
    /// `base_link` at `to_ns` in `base_link` at `from_ns`.
    pub relative: Pose2,
}

/// What counts as false, as a revisit, as recognised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopLimits {
    /// A loop whose translation is off by more is false, m.
    pub translation_m: f64,
    /// A loop whose rotation is off by more is false, degrees.
    pub rotation_deg: f64,
    /// A pose this near to an old one is a revisit, m.
    pub revisit_m: f64,
    /// A pose is old that lies at least this much path back, m.
    pub revisit_path_m: f64,
    /// A revisit is recalled by a true loop whose newer end is at most this much path away, m.
    pub recall_path_m: f64,
}

impl Default for LoopLimits {
    /// For radars whose scans are good to centimetres. A Navtech's, with cells of metres, need 2 m
    /// of translation.
    fn default() -> Self {
        Self {
            translation_m: 0.5,
            rotation_deg: 5.0,
            revisit_m: 1.0,
            revisit_path_m: 20.0,
            recall_path_m: 2.0,
        }
    }
}

/// A loop whose pose the truth contradicts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FalseLoop {
    /// The loop.
    pub edge: LoopEdge,
    /// How far it is off, m.
    pub error_m: f64,
    /// How much its heading is off, degrees.
    pub error_deg: f64,
}

/// Loops judged by the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopEvaluation {
    /// Loops given.
    pub loops: usize,
    /// Of those, loops for which the truth has no pose at one end: neither true nor false.
    pub unjudged: usize,
    /// Loops that are off by more than the limits, in the order given.
    pub false_loops: Vec<FalseLoop>,
    /// Poses of the estimate that stand where the robot was long before.
    pub revisits: usize,
    /// Of those, the ones with a true loop near.
    pub recalled: usize,
    /// Share of the revisits that were recalled; `None` where there are none.
    pub recall: Option<f64>,
}

/// Judges loops, and revisits at the stamps of the estimate's poses, by the truth alone.
///
/// A loop that reaches less than `revisit_path_m` back can be false, but recalls nothing: every
/// edge between neighbours would.
pub fn evaluate_loops(
    loops: &[LoopEdge],
    estimate: &Trajectory,
    truth: &Trajectory,
    limits: &LoopLimits,
) -> Result<LoopEvaluation, Error> {
    for (trajectory, name) in [(estimate, "estimate"), (truth, "truth")] {
        if !trajectory.is_stamped() {
            return Err(Error::NoStamps { name });
        }
    }
    let timeline = Timeline::new(truth);
    let mut false_loops = Vec::new();
    let mut unjudged = 0;
    // Path at the newer end of each true loop that reaches far enough back.
    let mut true_path_m = Vec::new();
    for edge in loops {
        let ends = (timeline.at(edge.from_ns), timeline.at(edge.to_ns));
        let (Some(from), Some(to)) = ends else {
            unjudged += 1;
            continue;
        };
        if from.frame != to.frame {
            unjudged += 1;
            continue;
        }
        let is = from.transform.between(&to.transform);
        let error = is.between(&edge.relative.into());
        let (error_m, error_deg) = (error.distance_m(), error.angle_rad().to_degrees());
        // A figure that is not a number is no true loop either.
        if !(error_m <= limits.translation_m && error_deg <= limits.rotation_deg) {
            false_loops.push(FalseLoop {
                edge: *edge,
                error_m,
                error_deg,
            });
        } else if (to.path_m - from.path_m).abs() >= limits.revisit_path_m {
            true_path_m.push(to.path_m.max(from.path_m));
        }
    }
    true_path_m.sort_by(f64::total_cmp);

    let poses: Vec<Instant> = estimate
        .poses()
        .iter()
        .filter_map(|pose| timeline.at(pose.stamp_ns))
        .collect();
    let (mut revisits, mut recalled) = (0, 0);
    for (index, pose) in poses.iter().enumerate() {
        let old = poses
            .iter()
            .take(index)
            .take_while(|old| pose.path_m - old.path_m >= limits.revisit_path_m);
        let near = |old: &Instant| pose.distance_m(old).is_some_and(|d| d <= limits.revisit_m);
        if old.into_iter().any(near) {
            revisits += 1;
            let next =
                true_path_m.partition_point(|path| *path < pose.path_m - limits.recall_path_m);
            let close = |path: &f64| *path <= pose.path_m + limits.recall_path_m;
            recalled += usize::from(true_path_m.get(next).is_some_and(close));
        }
    }
    Ok(LoopEvaluation {
        loops: loops.len(),
        unjudged,
        false_loops,
        revisits,
        recalled,
        recall: (revisits > 0).then(|| recalled as f64 / revisits as f64),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Poses a second.
    const RATE: i64 = 4;
    /// Path of one round, m.
    const ROUND_M: f64 = 40.0;

    fn stamp_ns(pose: i64) -> i64 {
        pose * 1_000_000_000 / RATE
    }

    /// The pose after some path around a circle.
    fn on_circle(path_m: f64) -> Pose2 {
        let twist = [ROUND_M, 0.0, TAU].map(|v| v * path_m / ROUND_M);
        Pose2::exp(twist.into())
    }

    /// A quarter of a metre a pose, two rounds: every pose of the second one is a revisit.
    fn two_rounds() -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        for pose in 0..320 {
            trajectory.push(stamp_ns(pose), 0, on_circle(0.25 * pose as f64));
        }
        trajectory
    }

    /// A loop between two poses, off by some motion.
    fn edge(from: i64, to: i64, error: Pose2) -> LoopEdge {
        let [a, b] = [from, to].map(|pose| on_circle(0.25 * pose as f64));
        LoopEdge {
            from_ns: stamp_ns(from),
            to_ns: stamp_ns(to),
            relative: a.between(&b).compose(&error),
        }
    }

    fn judged(loops: &[LoopEdge]) -> LoopEvaluation {
        let truth = two_rounds();
        evaluate_loops(loops, &truth, &truth, &LoopLimits::default()).unwrap()
    }

    #[test]
    fn false_is_what_is_off_by_half_a_metre_or_five_degrees() {
        let off = |x_m: f64, deg: f64| edge(10, 172, Pose2::new(0.0, x_m, deg.to_radians()));
        for (loops, expected) in [
            ([off(0.0, 0.0), off(0.49, 4.9)], 0),
            ([off(0.51, 0.0), off(0.0, -5.1)], 2),
            ([off(0.0, 180.0), off(f64::NAN, 0.0)], 2),
        ] {
            let evaluation = judged(&loops);
            assert_eq!(evaluation.false_loops.len(), expected, "{evaluation:?}");
            assert_eq!((evaluation.loops, evaluation.unjudged), (2, 0));
        }
        let evaluation = judged(&[off(3.0, 90.0)]);
        assert!((evaluation.false_loops[0].error_m - 3.0).abs() < 1e-9);
        assert!((evaluation.false_loops[0].error_deg - 90.0).abs() < 1e-6);
        let navtech = LoopLimits {
            translation_m: 2.0,
            ..LoopLimits::default()
        };
        let truth = two_rounds();
        let evaluation = evaluate_loops(&[off(1.9, 0.0)], &truth, &truth, &navtech).unwrap();
        assert!(evaluation.false_loops.is_empty());
    }

    #[test]
    fn the_second_round_is_revisits_from_a_metre_before_its_start() {
        // Within 1 m of the start is 4 poses before it, then all 160 of the second round.
        assert_eq!(judged(&[]).revisits, 164);
        assert_eq!(judged(&[]).recall, Some(0.0));
        // Less than 20 m of path is not long ago, whatever the distance.
        let mut short = Trajectory::stamped();
        (0..78)
            .for_each(|n| short.push(stamp_ns(n), 0, Pose2::new(0.25 * (n % 2) as f64, 0.0, 0.0)));
        let evaluation = evaluate_loops(&[], &short, &short, &LoopLimits::default()).unwrap();
        assert_eq!((evaluation.revisits, evaluation.recall), (0, None));
    }

    #[test]
    fn a_true_loop_recalls_two_metres_of_path_either_way() {
        // 8 poses on either side and its own.
        assert_eq!(judged(&[edge(80, 240, Pose2::IDENTITY)]).recalled, 17);
        // A false one recalls nothing, nor does an edge between neighbours.
        let false_one = edge(80, 240, Pose2::new(1.0, 0.0, 0.0));
        assert_eq!(judged(&[false_one]).recalled, 0);
        assert_eq!(judged(&[edge(236, 240, Pose2::IDENTITY)]).recalled, 0);
        let all: Vec<LoopEdge> = (156..320)
            .step_by(16)
            .map(|to| edge(to - 156, to, Pose2::IDENTITY))
            .collect();
        assert_eq!(judged(&all).recall, Some(1.0));
    }

    #[test]
    fn stamps_between_the_truths_are_interpolated_and_those_outside_left_open() {
        let mut between = edge(10, 170, Pose2::IDENTITY);
        between.to_ns += 125_000_000;
        between.relative = on_circle(2.5).between(&on_circle(42.625));
        let mut outside = edge(10, 170, Pose2::IDENTITY);
        outside.to_ns = stamp_ns(1000);
        let evaluation = judged(&[between, outside]);
        assert!(evaluation.false_loops.is_empty());
        assert_eq!(evaluation.unjudged, 1);
    }

    #[test]
    fn rows_without_stamps_are_refused() {
        let truth = two_rounds();
        let rows = Trajectory::unstamped();
        let error = evaluate_loops(&[], &truth, &rows, &LoopLimits::default()).unwrap_err();
        assert!(error.to_string().starts_with("the truth has no stamps"));
    }
}
