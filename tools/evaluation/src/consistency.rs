//! Whether an estimate's covariance is that of its errors: the normalised estimation error squared
//! (NEES; Bar-Shalom 2001) of the motion over some scans.

use crate::timeline::{Instant, Timeline, relative_error};
use crate::{Trajectory, Transform};
use nalgebra::{Matrix2, Matrix3, Vector3};
use randt_geometry::Pose2;

/// Below it a consistent estimate's NEES lies with a probability of 95 %: the quantile of the
/// chi^2 distribution of 3 degrees of freedom.
const INSIDE_95: f64 = 7.815;
/// The same of a position, with 2 degrees of freedom.
const INSIDE_95_POSITION: f64 = 5.991;
/// Scans over which the motion is taken: two seconds of an iSDR-C, in which the live estimate has
/// left none of them behind for good.
const SCANS: usize = 10;
/// Motion over them that is none, m and rad.
const STANDSTILL_M: f64 = 0.02;
const STANDSTILL_RAD: f64 = 0.01;
/// Motion that is a turn from here on, rad: 0.1 rad/s.
const TURN_RAD: f64 = 0.2;

/// The live estimate of one scan, as it was published.
#[derive(Clone, Copy, Debug)]
pub struct ScanEstimate {
    /// Stamp of the scan.
    pub stamp_ns: i64,
    /// Its odometry frame.
    pub frame: u64,
    /// `base_link` in that frame.
    pub pose: Pose2,
    /// Of x, y and yaw in `base_link`, as a perturbation on the right.
    pub covariance: Matrix3<f64>,
}

/// How the robot moved meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Not at all.
    Standstill,
    /// Ahead.
    Straight,
    /// By 0.2 rad and more.
    Turn,
}

/// One normalised error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalizedError {
    /// Stamp of the scan at its end.
    pub stamp_ns: i64,
    /// Error squared over its covariance; 3 on average where the covariance is right.
    pub nees: f64,
    /// What the robot did.
    pub motion: Motion,
}

impl NormalizedError {
    /// Whether the error lies inside the ellipsoid of 95 %.
    pub fn is_inside(&self) -> bool {
        self.nees <= INSIDE_95
    }
}

/// The error of the motion between two scans, as a twist at its end, and the covariance that was
/// published for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionError {
    /// x m, y m, yaw rad.
    pub error: Vector3<f64>,
    /// Sum of the covariances of both ends, in the frame of the last one.
    pub covariance: Matrix3<f64>,
    /// How the robot truly moved.
    moved: Transform,
}

impl MotionError {
    /// Error squared over its covariance; none where that has no inverse.
    pub fn nees(&self) -> Option<f64> {
        let information = self.covariance.try_inverse()?;
        let nees = (self.error.transpose() * information * self.error).x;
        nees.is_finite().then_some(nees)
    }

    /// Whether the error lies inside the ellipsoid of 95 %; none where that has no volume.
    pub fn is_inside(&self) -> Option<bool> {
        self.nees().map(|nees| nees <= INSIDE_95)
    }

    /// Distance of the position from the true one, m.
    pub fn distance_m(&self) -> f64 {
        self.error.xy().norm()
    }

    /// Whether the position lies inside the ellipse of 95 %; none where that has no area.
    pub fn is_inside_ellipse(&self) -> Option<bool> {
        let information = self.position_covariance().try_inverse()?;
        let error = self.error.xy();
        Some((error.transpose() * information * error).x <= INSIDE_95_POSITION)
    }

    /// The ellipse's larger semi-axis, m.
    pub fn semi_axis_m(&self) -> f64 {
        let covariance = self.position_covariance();
        let (mean, half) = (
            0.5 * covariance.trace(),
            0.5 * (covariance.m11 - covariance.m22),
        );
        let larger = mean + (half * half + covariance.m12 * covariance.m12).sqrt();
        (INSIDE_95_POSITION * larger).sqrt()
    }

    fn position_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into_owned()
    }
}

/// Motions of an estimate against the truth.
pub struct MotionErrors<'a> {
    truth: Timeline<'a>,
}

impl<'a> MotionErrors<'a> {
    /// Against this truth.
    pub fn new(truth: &'a Trajectory) -> Self {
        let truth = Timeline::new(truth);
        Self { truth }
    }

    /// Between two scans; none where their frames differ or one has no covariance.
    ///
    /// The published covariance of a pose does not say how it goes together with that of an
    /// earlier one: the two count as independent.
    pub fn between(&self, from: &ScanEstimate, to: &ScanEstimate) -> Option<MotionError> {
        let has_both = from.covariance.determinant() > 0.0 && to.covariance.determinant() > 0.0;
        let back = to.pose.between(&from.pose).adjoint();
        let covariance = to.covariance + back * from.covariance * back.transpose();
        let ends = [from, to].map(|scan| (scan.stamp_ns, scan.pose));
        let is_one_frame = from.frame == to.frame;
        (is_one_frame && has_both).then(|| self.relative(ends, covariance))?
    }

    /// Between two stamps with their poses in one frame, the covariance being that of the later
    /// pose seen from the earlier one.
    pub fn relative(
        &self,
        [from, to]: [(i64, Pose2); 2],
        covariance: Matrix3<f64>,
    ) -> Option<MotionError> {
        let [there, here] = [self.truth.at(from.0)?, self.truth.at(to.0)?];
        let estimate = |pose: Pose2, truth: &Instant| Instant {
            transform: pose.into(),
            ..*truth
        };
        let ends = [estimate(from.1, &there), estimate(to.1, &here)];
        let error = relative_error((&ends[0], &there), (&ends[1], &here))?;
        Some(MotionError {
            error: error.pose().log(),
            covariance,
            moved: there.transform.between(&here.transform),
        })
    }
}

/// The errors of the motion over every ten scans of one frame.
pub fn normalized_errors(estimates: &[ScanEstimate], truth: &Trajectory) -> Vec<NormalizedError> {
    let errors = MotionErrors::new(truth);
    let one = |(from, to): (&ScanEstimate, &ScanEstimate)| {
        let error = errors.between(from, to)?;
        let (turn_rad, distance_m) = (error.moved.angle_rad(), error.moved.distance_m());
        let motion = if turn_rad >= TURN_RAD {
            Motion::Turn
        } else if distance_m < STANDSTILL_M && turn_rad < STANDSTILL_RAD {
            Motion::Standstill
        } else {
            Motion::Straight
        };
        Some(NormalizedError {
            stamp_ns: to.stamp_ns,
            nees: error.nees()?,
            motion,
        })
    };
    let ends = estimates.iter().skip(SCANS);
    estimates.iter().zip(ends).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN_NS: i64 = 200_000_000;
    /// 2 cm and a degree.
    const SIGMA: [f64; 3] = [0.02, 0.02, 0.0175];

    /// Some scans: the truth, and estimates off by an error on the right.
    fn scans(
        step: [f64; 3],
        frame: impl Fn(i64) -> u64,
        error: impl Fn(i64) -> [f64; 3],
    ) -> (Vec<ScanEstimate>, Trajectory) {
        let (mut truth, mut pose) = (Trajectory::stamped(), Pose2::IDENTITY);
        let scan = |scan| {
            let there = pose;
            truth.push(scan * SCAN_NS, 0, there);
            pose = pose.compose(&Pose2::exp(step.into()));
            ScanEstimate {
                stamp_ns: scan * SCAN_NS,
                frame: frame(scan),
                pose: there.compose(&Pose2::exp(error(scan).into())),
                covariance: Matrix3::from_diagonal(&Vector3::from(SIGMA.map(|s| s * s))),
            }
        };
        let estimates = (0..30).map(scan).collect();
        (estimates, truth)
    }

    #[test]
    fn an_error_of_one_deviation_of_both_ends_is_one() {
        // Ahead, where the heading of the start plays no part.
        let deviation_m = 2_f64.sqrt() * SIGMA[0];
        let jump = |scan| [if scan < 15 { 0.0 } else { deviation_m }, 0.0, 0.0];
        let (estimates, truth) = scans([0.1, 0.0, 0.0], |_| 0, jump);
        let errors = normalized_errors(&estimates, &truth);
        assert_eq!(errors.len(), 20);
        for error in &errors {
            let sees_it = (15..25).contains(&(error.stamp_ns / SCAN_NS));
            let expected = if sees_it { 1.0 } else { 0.0 };
            assert!((error.nees - expected).abs() < 1e-9, "{error:?}");
            assert_eq!(error.motion, Motion::Straight);
            assert!(error.is_inside());
        }
    }

    #[test]
    fn the_starts_heading_lets_the_end_lie_beside() {
        // A metre on, a heading that is off by a degree shifts the end by 1.75 cm.
        let beside = |scan| [0.0, if scan < 15 { 0.0 } else { 0.06 }, 0.0];
        let (estimates, truth) = scans([0.1, 0.0, 0.0], |_| 0, beside);
        let (ends, _) = scans([0.0; 3], |_| 0, beside);
        let largest = |estimates: &[ScanEstimate], truth: &Trajectory| {
            let errors = normalized_errors(estimates, truth);
            errors.iter().map(|e| e.nees).fold(0.0, f64::max)
        };
        let (_, still) = scans([0.0; 3], |_| 0, |_| [0.0; 3]);
        let (driven, stood) = (largest(&estimates, &truth), largest(&ends, &still));
        assert!((stood - 4.5).abs() < 1e-6, "{stood}");
        assert!(driven < 0.9 * stood, "{driven}");
    }

    #[test]
    fn the_ellipse_of_a_position_is_2_4_deviations_long() {
        let ahead = |error_m| move |scan| [if scan < 15 { 0.0 } else { error_m }, 0.0, 0.0];
        let between = |error_m| {
            let (estimates, truth) = scans([0.0; 3], |_| 0, ahead(error_m));
            let errors = MotionErrors::new(&truth);
            errors.between(&estimates[10], &estimates[20]).unwrap()
        };
        // 5.991^0.5 deviations of both ends.
        let semi_axis_m = 5.991_f64.sqrt() * 2_f64.sqrt() * SIGMA[0];
        for (error_m, is_inside) in [(0.0, true), (0.069, true), (0.0695, false)] {
            let error = between(error_m);
            assert!((error.semi_axis_m() - semi_axis_m).abs() < 1e-4);
            assert!((error.distance_m() - error_m).abs() < 1e-9);
            assert_eq!(error.is_inside_ellipse(), Some(is_inside), "{error_m}");
        }
    }

    #[test]
    fn frames_and_scans_without_covariance_are_left_out_and_motions_are_named() {
        let none = |_| [0.0; 3];
        let (estimates, truth) = scans([0.0; 3], |scan| u64::from(scan >= 15), none);
        let errors = normalized_errors(&estimates, &truth);
        // Five that end in the first frame, five that begin in the second.
        assert_eq!(errors.len(), 10);
        assert!(errors.iter().all(|e| e.motion == Motion::Standstill));
        let (mut estimates, truth) = scans([0.1, 0.0, 0.03], |_| 0, none);
        estimates[0].covariance = Matrix3::zeros();
        let errors = normalized_errors(&estimates, &truth);
        assert_eq!(errors.len(), 19);
        assert!(errors.iter().all(|e| e.motion == Motion::Turn));
    }
}
