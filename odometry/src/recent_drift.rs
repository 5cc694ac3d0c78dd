//! How far the position may have drifted over the last metres, where the cells did not hold it.

use nalgebra::{Matrix2, SymmetricEigen};
use randt_persist::persist;

/// Metres that it looks back: half of the ten that a pose is judged over.
const SPAN_M: usize = 5;

/// Covariance of the position in `odom` by metre of the way.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecentDrift {
    /// The newest metre first, m^2.
    covariances_m2: [Matrix2<f64>; SPAN_M],
    /// Way within the newest metre, m.
    way_m: f64,
}

persist!(RecentDrift {
    covariances_m2,
    way_m
});

impl RecentDrift {
    /// The robot moved on by a way in which the position drifted by a covariance.
    pub fn advance(&mut self, way_m: f64, covariance_m2: &Matrix2<f64>) {
        self.way_m += way_m;
        if self.way_m >= 1.0 {
            self.way_m = self.way_m.fract();
            self.covariances_m2.rotate_right(1);
            self.covariances_m2[0] = Matrix2::zeros();
        }
        self.covariances_m2[0] += covariance_m2;
    }

    /// Over the span, m^2.
    pub fn covariance_m2(&self) -> Matrix2<f64> {
        self.covariances_m2.iter().sum()
    }

    /// Its largest standard deviation, m.
    pub fn sigma_m(&self) -> f64 {
        let eigenvalues = self.covariance_m2().symmetric_eigenvalues();
        eigenvalues.max().max(0.0).sqrt()
    }

    /// A covariance of the position against the submap as that against where the robot was some
    /// metres ago: cells that were added while it drifted hold it among themselves alone.
    pub fn widen(&self, covariance_m2: &Matrix2<f64>) -> Matrix2<f64> {
        let drift = SymmetricEigen::new(self.covariance_m2());
        let mut widened = *covariance_m2;
        for (variance_m2, axis) in drift
            .eigenvalues
            .iter()
            .zip(drift.eigenvectors.column_iter())
        {
            let known_m2 = axis.dot(&(widened * axis));
            widened += axis * axis.transpose() * (variance_m2 - known_m2).max(0.0);
        }
        widened
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_is_forgotten_after_its_metres() {
        let mut drift = RecentDrift::default();
        let along_x = Matrix2::new(0.09, 0.0, 0.0, 0.0);
        drift.advance(0.1, &along_x);
        assert!((drift.sigma_m() - 0.3).abs() < 1e-12);
        for _ in 0..45 {
            drift.advance(0.1, &Matrix2::zeros());
        }
        assert!((drift.sigma_m() - 0.3).abs() < 1e-12);
        for _ in 0..5 {
            drift.advance(0.1, &Matrix2::zeros());
        }
        assert_eq!(drift.sigma_m(), 0.0);
    }

    #[test]
    fn a_covariance_is_widened_along_the_drift_alone_and_never_narrowed() {
        let mut drift = RecentDrift::default();
        drift.advance(0.1, &(Matrix2::new(1.0, 1.0, 1.0, 1.0) * 0.08));
        let known = Matrix2::identity() * 1e-4;
        let widened = drift.widen(&known);
        let eigen = SymmetricEigen::new(widened);
        assert!((eigen.eigenvalues.max() - 0.16).abs() < 1e-12);
        assert!((eigen.eigenvalues.min() - 1e-4).abs() < 1e-12);
        let wide = Matrix2::identity();
        assert!((drift.widen(&wide) - wide).norm() < 1e-12);
    }
}
