//! Relative errors: per step (RPE) and per 100 to 800 m of path (KITTI drift).

use crate::Transform;
use crate::pairs::Pair;

/// KITTI takes every tenth pose as a start.
const START_STEP: usize = 10;
/// KITTI's lengths of path, m.
const LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];

/// A mean translation error and a mean rotation error; units as at the function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mean {
    pub translation: f64,
    pub rotation: f64,
}

/// Sums errors, then gives their mean.
#[derive(Default)]
struct Sum {
    translation: f64,
    rotation: f64,
    count: usize,
}

impl Sum {
    /// Adds an error, divided by a length.
    fn add(&mut self, error: &Transform, length: f64) {
        self.translation += error.distance_m() / length;
        self.rotation += error.angle_rad() / length;
        self.count += 1;
    }

    fn mean(&self) -> Option<Mean> {
        let count = self.count as f64;
        (self.count > 0).then(|| Mean {
            translation: self.translation / count,
            rotation: self.rotation / count,
        })
    }
}

/// The motion between two instants, estimated and true.
///
/// Which of the two an error is seen from matters in its fifth digit, where matrices are rounded
/// to six: drift and RPE are published with different ones.
fn motions(from: &Pair, to: &Pair) -> (Transform, Transform) {
    (
        from.estimate.between(&to.estimate),
        from.truth.between(&to.truth),
    )
}

/// Mean error of the motion between neighbouring poses of the truth, m and rad.
pub(crate) fn per_step(pairs: &[Pair]) -> Option<Mean> {
    let mut sum = Sum::default();
    for (from, to) in pairs.iter().zip(pairs.iter().skip(1)) {
        if from.frame == to.frame && from.index + 1 == to.index {
            let (estimate, truth) = motions(from, to);
            sum.add(&truth.between(&estimate), 1.0);
        }
    }
    sum.mean()
}

/// KITTI drift: mean error per length over all stretches of 100 to 800 m inside one frame, m/m and
/// rad/m.
///
/// A stretch ends at the first pose farther along the truth's path than its start plus its length.
/// `path_m` is the path up to each pose of the truth. `None` where no frame is long enough.
pub(crate) fn drift(pairs: &[Pair], path_m: &[f64]) -> Option<Mean> {
    let path = |pair: &Pair| path_m.get(pair.index).copied().unwrap_or_default();
    let mut sum = Sum::default();
    for frame in pairs.chunk_by(|a, b| a.frame == b.frame) {
        for from in frame.iter().step_by(START_STEP) {
            for length_m in LENGTHS_M {
                let end = frame.partition_point(|to| path(to) <= path(from) + length_m);
                if let Some(to) = frame.get(end) {
                    let (estimate, truth) = motions(from, to);
                    sum.add(&estimate.between(&truth), length_m);
                }
            }
        }
    }
    sum.mean()
}
