//! The estimate of one keyframe seen from another.

use nalgebra::{Matrix3, Vector3};
use randt_geometry::{
    Pose2,
    elementary::{ln, wrap},
};

/// Where the estimate has the newer keyframe, seen from the older one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prior {
    /// The pose.
    pub older_from_newer: Pose2,
    /// Its covariance (x, y, yaw), in the newer keyframe's frame; m^2, m rad, rad^2.
    pub covariance: Matrix3<f64>,
}

impl Prior {
    /// Standard deviation along the least certain direction of the position, m.
    pub fn sigma_m(&self) -> f64 {
        position_sigma_m(&self.covariance)
    }

    /// Standard deviation of the heading, rad.
    pub fn sigma_rad(&self) -> f64 {
        self.covariance.m33.max(0.0).sqrt()
    }

    /// Squared deviation of a measured pose, weighed by its covariance and the prior's.
    pub fn chi2(&self, measured: &Pose2, covariance: &Matrix3<f64>) -> f64 {
        let off = deviation(&self.older_from_newer, measured);
        let Some(cholesky) = (self.covariance + covariance).cholesky() else {
            return f64::INFINITY;
        };
        off.dot(&cholesky.solve(&off))
    }

    /// The information that a measurement of this covariance would add, nats: half the logarithm
    /// of how many times it shrinks the volume of the prior's covariance.
    pub fn information_gain(&self, covariance: &Matrix3<f64>) -> f64 {
        let [both, own] = [self.covariance + covariance, *covariance].map(|c| c.determinant());
        match own > 0.0 && both > own {
            true => 0.5 * ln(both / own),
            false => 0.0,
        }
    }
}

/// Standard deviation along the least certain direction of the position of a covariance of (x, y,
/// yaw), m.
pub(crate) fn position_sigma_m(c: &Matrix3<f64>) -> f64 {
    let radius = (0.25 * (c.m11 - c.m22) * (c.m11 - c.m22) + c.m12 * c.m12).sqrt();
    (0.5 * (c.m11 + c.m22) + radius).max(0.0).sqrt()
}

/// `expected` seen from `measured`: x m, y m, yaw rad.
pub(crate) fn deviation(expected: &Pose2, measured: &Pose2) -> Vector3<f64> {
    let off = measured.between(expected);
    Vector3::new(off.x_m, off.y_m, wrap(off.yaw_rad))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_weighed_by_both_covariances_in_the_measured_frame() {
        let prior = Prior {
            older_from_newer: Pose2::new(3.0, 1.0, 1.0),
            covariance: Matrix3::from_diagonal(&Vector3::new(0.03, 0.01, 0.0005)),
        };
        let own = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.0005));
        // 0.2 m ahead of where it should be, in its own frame: 0.04 / 0.04.
        let expected = prior.older_from_newer;
        let ahead = expected.compose(&Pose2::new(0.2, 0.0, 0.0));
        assert!((prior.chi2(&ahead, &own) - 1.0).abs() < 1e-9);
        let turned = expected.compose(&Pose2::new(0.0, 0.0, -0.1));
        assert!((prior.chi2(&turned, &own) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_measurement_as_good_as_the_estimate_gains_half_a_doubling_an_axis() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(0.03, 0.01, 0.0005));
        let prior = Prior {
            older_from_newer: Pose2::IDENTITY,
            covariance,
        };
        let half = 0.5 * core::f64::consts::LN_2;
        assert!((prior.information_gain(&covariance) - 3.0 * half).abs() < 1e-12);
        assert!(prior.information_gain(&(covariance * 100.0)) < 0.02);
        // What is known exactly gains nothing.
        let exact = Prior {
            covariance: Matrix3::zeros(),
            ..prior
        };
        assert_eq!(exact.information_gain(&covariance), 0.0);
    }
}
