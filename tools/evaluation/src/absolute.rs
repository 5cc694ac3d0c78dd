//! Absolute trajectory error: how far the estimate is off after the best rigid alignment.

use crate::Transform;
use crate::pairs::Pair;

/// Two points can always be laid onto two others but for their distance.
const POSES_MIN: usize = 3;

/// Root mean square of the distance between positions after rigid least-squares alignment without
/// scale (Umeyama 1991, in the plane in closed form), m.
///
/// Every frame is aligned by itself and the squared errors are pooled; frames of fewer than three
/// poses are left out. `None` where nothing is left.
pub(crate) fn ate_rmse_m(pairs: &[Pair]) -> Option<f64> {
    let mut sum = 0.0;
    let mut count = 0;
    for frame in pairs.chunk_by(|a, b| a.frame == b.frame) {
        if frame.len() >= POSES_MIN {
            sum += aligned_square_error(frame);
            count += frame.len();
        }
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Sum of the squared distances after alignment, m^2.
fn aligned_square_error(frame: &[Pair]) -> f64 {
    let alignment = Alignment::from_pairs(frame);
    let squares = frame.iter().map(|pair| {
        let [x_m, y_m] = alignment.estimate_on_truth([pair.estimate.x_m, pair.estimate.y_m]);
        let (dx, dy) = (x_m - pair.truth.x_m, y_m - pair.truth.y_m);
        dx * dx + dy * dy
    });
    squares.sum()
}

/// The rigid motion that lays an estimate onto the truth: a turn about the mean positions.
pub(crate) struct Alignment {
    estimate: [f64; 2],
    truth: [f64; 2],
    cos: f64,
    sin: f64,
}

impl Alignment {
    /// The one of least squared distance.
    pub fn from_pairs(frame: &[Pair]) -> Self {
        let count = frame.len().max(1) as f64;
        let mean = |value: fn(&Pair) -> f64| frame.iter().map(value).sum::<f64>() / count;
        let estimate = [mean(|p| p.estimate.x_m), mean(|p| p.estimate.y_m)];
        let truth = [mean(|p| p.truth.x_m), mean(|p| p.truth.y_m)];
        // The best angle's cosine and sine are as the sums of dot and cross products.
        let (mut dot, mut cross) = (0.0, 0.0);
        for pair in frame {
            let from = |at: &Transform, mean: [f64; 2]| [at.x_m - mean[0], at.y_m - mean[1]];
            let (e, t) = (from(&pair.estimate, estimate), from(&pair.truth, truth));
            dot += e[0] * t[0] + e[1] * t[1];
            cross += e[0] * t[1] - e[1] * t[0];
        }
        let norm = (dot * dot + cross * cross).sqrt();
        let (cos, sin) = match norm > 0.0 {
            true => (dot / norm, cross / norm),
            false => (1.0, 0.0),
        };
        Self {
            estimate,
            truth,
            cos,
            sin,
        }
    }

    /// A position of the estimate, seen from the truth's frame.
    fn estimate_on_truth(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x_m - self.estimate[0], y_m - self.estimate[1]);
        [
            self.cos * dx - self.sin * dy + self.truth[0],
            self.sin * dx + self.cos * dy + self.truth[1],
        ]
    }

    /// A position of the truth, seen from the estimate's frame.
    pub fn truth_on_estimate(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x_m - self.truth[0], y_m - self.truth[1]);
        [
            self.cos * dx + self.sin * dy + self.estimate[0],
            -self.sin * dx + self.cos * dy + self.estimate[1],
        ]
    }
}
