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
/// Weakest direction of a registration, m: beyond it a corridor's length was guessed. The warp alone makes 0.060 m of it,
/// a bare wall of which the grid makes all that is known along it 0.101 m at most. Over 19 simulated worlds 0.068 m
/// refuses two of three false loops (203 to 67) and one of 250 true ones (2,291 to 2,282).
const SIGMA_MAX_M: f64 = 0.068;
/// Moved along its least certain direction, a trail must be explained by at most this share of before. Of loops in bare
/// corridors that are metres off along them nearly nine in ten have more; of true loops one in fifty in the building, half
/// in the yard, where there is little to see.
const DISPLACED_MAX: f64 = 0.8;
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
        position_sigma_m(&self.covariance)
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

/// Standard deviation along the least certain direction of the position of a covariance of (x, y, yaw), m.
pub fn position_sigma_m(c: &Matrix3<f64>) -> f64 {
    let radius = (0.25 * (c.m11 - c.m22) * (c.m11 - c.m22) + c.m12 * c.m12).sqrt();
    (0.5 * (c.m11 + c.m22) + radius).max(0.0).sqrt()
}

/// `measured` seen from `expected`, in the measured frame.
pub fn deviation(expected: &Pose2, measured: &Pose2) -> Vector3<f64> {
    let off = measured.between(expected);
    Vector3::new(off.x_m, off.y_m, wrap(off.yaw_rad))
}

/// The gates, in order; `Ok` where all are passed.
pub fn judge(scores: &Scores, config: &Loops) -> Result<(), Fate> {
    is_alike(scores, config)?;
    is_fixed(scores)
}

/// Whether the places look like one, from both sides, where odometry has them.
pub fn is_alike(scores: &Scores, config: &Loops) -> Result<(), Fate> {
    let fit = scores
        .forward
        .zip(scores.backward)
        .map_or(0.0, |(a, b)| a.min(b));
    // Not a number is no agreement.
    if scores
        .chi2
        .is_some_and(|chi2| chi2.is_nan() || chi2 > CHI2_MAX)
    {
        return Err(Fate::AgainstOdometry);
    }
    if fit < config.fit_min {
        return Err(Fate::Unlike);
    }
    let divergence = scores.divergence;
    if divergence.is_none_or(|divergence| divergence > config.divergence_max) {
        return Err(Fate::Divergent);
    }
    let flipped_max = FLIPPED_MAX * fit;
    if scores.flipped.is_some_and(|flipped| flipped > flipped_max) {
        return Err(Fate::Ambiguous);
    }
    Ok(())
}

/// Whether a registration is fixed in every direction.
pub fn is_fixed(scores: &Scores) -> Result<(), Fate> {
    let displaced_max = DISPLACED_MAX * scores.forward.unwrap_or(0.0);
    let is_certain = scores.sigma_m.is_some_and(|sigma| sigma <= SIGMA_MAX_M);
    let displaced = scores.displaced;
    if is_certain && displaced.is_some_and(|displaced| displaced <= displaced_max) {
        return Ok(());
    }
    Err(Fate::Degenerate)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Scores {
        Scores {
            forward: Some(0.8),
            backward: Some(0.7),
            flipped: None,
            displaced: Some(0.5),
            divergence: Some(0.4),
            sigma_m: Some(0.06),
            chi2: Some(3.0),
            prior_sigma_m: Some(0.1),
        }
    }

    #[test]
    fn each_gate_says_what_it_refuses() {
        let config = Loops::default();
        let fate = |change: fn(&mut Scores)| {
            let mut scores = good();
            change(&mut scores);
            judge(&scores, &config)
        };
        assert_eq!(fate(|_| ()), Ok(()));
        assert_eq!(fate(|s| s.chi2 = Some(20.0)), Err(Fate::AgainstOdometry));
        assert_eq!(
            fate(|s| s.chi2 = Some(f64::NAN)),
            Err(Fate::AgainstOdometry)
        );
        assert_eq!(fate(|s| s.backward = Some(0.2)), Err(Fate::Unlike));
        assert_eq!(fate(|s| s.forward = None), Err(Fate::Unlike));
        assert_eq!(fate(|s| s.divergence = Some(4.0)), Err(Fate::Divergent));
        assert_eq!(fate(|s| s.sigma_m = Some(0.067)), Ok(()));
        // A bare wall.
        assert_eq!(fate(|s| s.sigma_m = Some(0.1)), Err(Fate::Degenerate));
        // A corridor fits as well a metre on.
        assert_eq!(fate(|s| s.displaced = Some(0.7)), Err(Fate::Degenerate));
        assert_eq!(fate(|s| s.flipped = Some(0.68)), Err(Fate::Ambiguous));
        // The opposite heading fits worse: no doubt.
        assert_eq!(fate(|s| s.flipped = Some(0.4)), Ok(()));
    }

    #[test]
    fn a_deviation_is_weighed_by_both_covariances_in_the_measured_frame() {
        let prior = Prior {
            pose: Pose2::new(3.0, 1.0, 1.0),
            covariance: Matrix3::from_diagonal(&Vector3::new(0.03, 0.01, 0.0005)),
        };
        let own = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.0005));
        // 0.2 m ahead of where it should be, in its own frame: 0.04 / 0.04.
        let ahead = prior.pose.compose(&Pose2::new(0.2, 0.0, 0.0));
        assert!((prior.chi2(&ahead, &own) - 1.0).abs() < 1e-9);
        let turned = prior.pose.compose(&Pose2::new(0.0, 0.0, -0.1));
        assert!((prior.chi2(&turned, &own) - 10.0).abs() < 1e-9);
        assert!(!prior.is_tight());
        let sharp = Prior {
            covariance: prior.covariance * 0.2,
            ..prior
        };
        assert!(sharp.is_tight() && (sharp.sigma_m() - 0.006_f64.sqrt()).abs() < 1e-12);
    }
}
