//! The gates that a loop candidate must pass before it may bend the map.
//!
//! False loops pass each gate alone (corridors look alike turned by 180 degrees, rooms look alike
//! shifted by a room). Together the gates ask whether a loop is seen from both sides, in the right
//! pose, and in no other.

use super::closure::{LoopStatus, Scores};
use crate::pose_graph::Prior;
use randt_config::Loops;

/// chi2 of three degrees of freedom that one true loop in a thousand exceeds.
pub(super) const CHI2_MAX: f64 = 16.3;
/// A loop farther off than this, m and rad, is false: 0.5 m and 5 degrees, with a margin for what
/// the registration itself may be off.
pub(super) const FALSE_M: f64 = 0.4;
pub(super) const FALSE_RAD: f64 = 0.07;
/// Deviations within which [`CHI2_MAX`] holds a loop.
const DEVIATIONS: f64 = 4.0;
/// Weakest direction of a registration, m: beyond it a corridor's length was guessed. The warp
/// alone makes 0.060 m of it, a bare wall of which the grid makes all that is known along it 0.101
/// m at most. Over 19 simulated worlds 0.068 m refuses two of three false loops (203 to 67) and
/// one of 250 true ones (2,291 to 2,282).
const SIGMA_MAX_M: f64 = 0.068;
/// Moved along its least certain direction, a query submap must be explained by at most this share
/// of before. Of loops in bare corridors that are metres off along them nearly nine in ten have
/// more; of true loops one in fifty in the building, half in the yard, where there is little to
/// see.
const DISPLACED_MAX: f64 = 0.8;
/// Any other pose that the estimate leaves open must explain at most this share of what the chosen
/// one does. Over 23 simulated drives 30 of 42 false loops that pass the other gates have more, and
/// eight of a hundred true ones, nearly all of them in corridors and behind glass.
const RIVAL_MAX: f64 = 0.85;

/// Whether no pose within the gate of odometry can be a false loop: one loop needs no support
/// then.
pub(super) fn is_tight(prior: &Prior) -> bool {
    DEVIATIONS * prior.sigma_m() < FALSE_M && DEVIATIONS * prior.sigma_rad() < FALSE_RAD
}

/// The gates, in order; `Ok` where all are passed.
pub(super) fn judge(scores: &Scores, config: &Loops) -> Result<(), LoopStatus> {
    is_alike(scores, config)?;
    is_fixed(scores)
}

/// Whether the keyframes look like one, from both sides, where odometry has them. In the merging
/// of components a refusal is a misfit.
pub(super) fn is_alike(scores: &Scores, config: &Loops) -> Result<(), LoopStatus> {
    let fit = scores.fit();
    // Not a number is no agreement.
    let is_far = |chi2: f64| chi2.is_nan() || chi2 > CHI2_MAX;
    if scores.chi2.is_some_and(is_far) {
        return Err(LoopStatus::AgainstOdometry);
    }
    if fit < config.fit_min {
        return Err(LoopStatus::Unlike);
    }
    let divergence = scores.divergence;
    if divergence.is_none_or(|divergence| divergence > config.divergence_max) {
        return Err(LoopStatus::Divergent);
    }
    let rival_max = RIVAL_MAX * fit;
    if scores.rival.is_some_and(|rival| rival > rival_max) {
        return Err(LoopStatus::Ambiguous);
    }
    Ok(())
}

/// Whether a registration is fixed in every direction. In the merging of components a refusal is a
/// fit that makes no loop.
pub(super) fn is_fixed(scores: &Scores) -> Result<(), LoopStatus> {
    let displaced_max = DISPLACED_MAX * scores.forward.unwrap_or(0.0);
    let is_certain = scores.sigma_m.is_some_and(|sigma| sigma <= SIGMA_MAX_M);
    let displaced = scores.displaced;
    if is_certain && displaced.is_some_and(|displaced| displaced <= displaced_max) {
        return Ok(());
    }
    Err(LoopStatus::Degenerate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use randt_geometry::Pose2;

    fn good() -> Scores {
        Scores {
            forward: Some(0.8),
            backward: Some(0.7),
            rival: None,
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
        let status = |change: fn(&mut Scores)| {
            let mut scores = good();
            change(&mut scores);
            judge(&scores, &config)
        };
        assert_eq!(status(|_| ()), Ok(()));
        assert_eq!(
            status(|s| s.chi2 = Some(20.0)),
            Err(LoopStatus::AgainstOdometry)
        );
        assert_eq!(
            status(|s| s.chi2 = Some(f64::NAN)),
            Err(LoopStatus::AgainstOdometry)
        );
        assert_eq!(status(|s| s.backward = Some(0.2)), Err(LoopStatus::Unlike));
        assert_eq!(status(|s| s.forward = None), Err(LoopStatus::Unlike));
        assert_eq!(
            status(|s| s.divergence = Some(4.0)),
            Err(LoopStatus::Divergent)
        );
        assert_eq!(status(|s| s.sigma_m = Some(0.067)), Ok(()));
        // A bare wall.
        assert_eq!(
            status(|s| s.sigma_m = Some(0.1)),
            Err(LoopStatus::Degenerate)
        );
        // No scan of the query saw every direction.
        assert_eq!(status(|s| s.sigma_m = None), Err(LoopStatus::Degenerate));
        // A corridor fits as well a metre on.
        assert_eq!(
            status(|s| s.displaced = Some(0.7)),
            Err(LoopStatus::Degenerate)
        );
        assert_eq!(status(|s| s.rival = Some(0.68)), Err(LoopStatus::Ambiguous));
        // Any other pose fits worse: no doubt.
        assert_eq!(status(|s| s.rival = Some(0.4)), Ok(()));
    }

    #[test]
    fn a_prior_is_tight_where_four_deviations_make_no_false_loop() {
        let covariance = Matrix3::from_diagonal(&[0.03, 0.01, 0.0005].into());
        let prior = |share: f64| Prior {
            older_from_newer: Pose2::IDENTITY,
            covariance: covariance * share,
        };
        assert!(!is_tight(&prior(1.0)));
        let sharp = prior(0.2);
        assert!(is_tight(&sharp) && (sharp.sigma_m() - 0.006_f64.sqrt()).abs() < 1e-12);
    }
}
