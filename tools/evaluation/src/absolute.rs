//! Absolute trajectory error: how far the estimate is off after the best rigid alignment.

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
    let count = frame.len() as f64;
    let mean = |of: fn(&Pair) -> f64| frame.iter().map(of).sum::<f64>() / count;
    let estimate = [mean(|p| p.estimate.x_m), mean(|p| p.estimate.y_m)];
    let truth = [mean(|p| p.truth.x_m), mean(|p| p.truth.y_m)];
    let centred = |p: &Pair| {
        (
            [p.estimate.x_m - estimate[0], p.estimate.y_m - estimate[1]],
            [p.truth.x_m - truth[0], p.truth.y_m - truth[1]],
        )
    };
    // The best angle's cosine and sine are as the sums of dot and cross products.
    let (mut dot, mut cross) = (0.0, 0.0);
    for pair in frame {
        let (e, t) = centred(pair);
        dot += e[0] * t[0] + e[1] * t[1];
        cross += e[0] * t[1] - e[1] * t[0];
    }
    let norm = (dot * dot + cross * cross).sqrt();
    let (cos, sin) = if norm > 0.0 {
        (dot / norm, cross / norm)
    } else {
        (1.0, 0.0)
    };
    frame
        .iter()
        .map(|pair| {
            let (e, t) = centred(pair);
            let dx = cos * e[0] - sin * e[1] - t[0];
            let dy = sin * e[0] + cos * e[1] - t[1];
            dx * dx + dy * dy
        })
        .sum()
}
