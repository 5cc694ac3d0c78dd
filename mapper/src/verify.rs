//! The gates that a loop candidate must pass before it may bend the map.
//!
//! Each gate alone is passed by false loops (corridors look alike turned by 180 degrees, rooms look alike shifted by a
//! room); together they ask whether a loop is seen from both sides, in the right place, and in no other.

use crate::candidate::{Fate, Scores};
use nalgebra::{Matrix3, Vector3};
use randt_config::Loops;
use randt_geometry::{Pose2, elementary::wrap};

/// chi2 of three degrees of freedom that one true loop in a thousand exceeds.
pub const CHI2_MAX: f64 = 16.3;
/// A loop farther off than this, m and rad, is false: the words of the design (0.5 m, 5 degrees), with a margin for what
/// the registration itself may be off.
const FALSE_M: f64 = 0.4;
const FALSE_RAD: f64 = 0.07;
/// Deviations within which [`CHI2_MAX`] holds a loop.
const DEVIATIONS: f64 = 4.0;
/// Weakest direction of a registration, m: beyond it a corridor's length was guessed.
const SIGMA_MAX_M: f64 = 0.15;
/// The opposite heading must explain at most this share of what the chosen one does.
const FLIPPED_MAX: f64 = 0.85;

/// Where the estimate says that the newer place is, seen from the older one.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// The pose.
    pub pose: Pose2,
    /// Its covariance, in the newer place's frame.
    pub covariance: Matrix3<f64>,
}

impl Prior {
    /// Standard deviation along the least certain direction of the position, m.
    pub fn sigma_m(&self) -> f64 {
        let c = &self.covariance;
        let radius = (0.25 * (c.m11 - c.m22) * (c.m11 - c.m22) + c.m12 * c.m12).sqrt();
        (0.5 * (c.m11 + c.m22) + radius).max(0.0).sqrt()
    }

    /// Standard deviation of the heading, rad.
    pub fn sigma_rad(&self) -> f64 {
        self.covariance.m33.max(0.0).sqrt()
    }

    /// Squared deviation of a measured pose of this covariance, weighed.
    pub fn chi2(&self, measured: &Pose2, covariance: &Matrix3<f64>) -> f64 {
        let off = deviation(&self.pose, measured);
        let Some(cholesky) = (self.covariance + covariance).cholesky() else {
            return f64::INFINITY;
        };
        off.dot(&cholesky.solve(&off))
    }

    /// Whether no pose within the gate of odometry can be a false loop: one loop needs no witness then.
    pub fn is_tight(&self) -> bool {
        DEVIATIONS * self.sigma_m() < FALSE_M && DEVIATIONS * self.sigma_rad() < FALSE_RAD
    }
}

/// `measured` seen from `expected`, in the measured frame.
pub fn deviation(expected: &Pose2, measured: &Pose2) -> Vector3<f64> {
    let off = measured.between(expected);
    Vector3::new(off.x_m, off.y_m, wrap(off.yaw_rad))
}

/// The gates, in order; `Ok` where all are passed.
pub fn judge(scores: &Scores, config: &Loops) -> Result<(), Fate> {
    let fit = scores
        .forward
        .zip(scores.backward)
        .map_or(0.0, |(a, b)| a.min(b));
    if scores
        .chi2
        .is_some_and(|chi2| chi2.is_nan() || chi2 > CHI2_MAX)
    {
        return Err(Fate::AgainstOdometry);
    }
    if fit < config.fit_min {
        return Err(Fate::Unlike);
    }
    if scores
        .divergence
        .is_none_or(|divergence| divergence > config.divergence_max)
    {
        return Err(Fate::Divergent);
    }
    if scores.sigma_m.is_none_or(|sigma| sigma > SIGMA_MAX_M) {
        return Err(Fate::Degenerate);
    }
    if scores
        .flipped
        .is_some_and(|flipped| flipped > FLIPPED_MAX * fit)
    {
        return Err(Fate::Ambiguous);
    }
    Ok(())
}
