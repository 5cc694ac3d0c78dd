//! Whether a registration is the only one that the estimate leaves open.
//!
//! Pillars, doors and rooms repeat themselves, by whole cells too, and a registration ends at
//! whichever repetition it began near. So the fit is followed along the line on which the estimate
//! is least certain, and each of its maxima is registered. The best is the loop; another one that
//! is as probable and fits nearly as well is its rival, and the loop is ambiguous.

use super::LoopVerification;
use super::closure::LoopClosure;
use super::gates::{CHI2_MAX, FALSE_M, FALSE_RAD};
use super::registration::Registration;
use crate::keyframe::MapKeyframe;
use crate::pose_graph::{Prior, deviation};
use nalgebra::Vector3;
use randt_geometry::{
    Pose2,
    elementary::{atan2, sin_cos},
};

/// Standard deviations of the estimate that the line covers to either side.
const REACH_DEVIATIONS: f64 = 3.0;
/// Poses of the line are this many cells apart, so that every end of a registration has a beginning
/// within a quarter of a cell; repetitions of a whole number of cells are among them.
const STEP_CELLS: f64 = 0.5;
/// Steps of a line to either side at most: a standard deviation of 20 m, beyond which nothing is
/// known.
const STEPS_MAX: f64 = 128.0;
/// Maxima that are registered, the best first.
const MAXIMA_MAX: usize = 8;
/// Another pose takes the place of the one that was found where it fits better by this.
const BETTER_MIN: f64 = 0.02;
/// A rival whose chi2 exceeds the best pose's by this is no rival: three standard deviations.
/// Without it, drives along glass lose 5 to 10 points of recall.
const CHI2_MARGIN: f64 = 9.0;

/// A pose of the query in the submap that the estimate leaves open.
struct Mode {
    pose: Pose2,
    fit: f64,
    chi2: f64,
}

impl LoopVerification {
    /// Looks for other poses that the estimate leaves open to a closure; the best one becomes the
    /// closure's, and the best of the others its rival.
    pub(super) fn seek_rivals(
        &mut self,
        closure: &mut LoopClosure,
        prior: &Prior,
        keyframes: &[MapKeyframe],
    ) {
        let found = closure.older_from_newer;
        let scores = closure.scores;
        let fit = scores.fit();
        let chi2 = scores.chi2.unwrap_or(CHI2_MAX);
        let pose = found;
        let mut modes = vec![Mode { pose, fit, chi2 }];
        let line = line(&found, prior, STEP_CELLS * self.config.cell_size_m());
        let grid = self.submaps.grid(closure.older, keyframes);
        let maxima = grid.map(|grid| self.registrar.maxima(grid, &self.query, &line));
        for start in maxima.iter().flatten().take(MAXIMA_MAX) {
            let mode = self.register(closure.older, &[*start], keyframes);
            modes.extend(mode.map(|registered| Mode::new(&registered, prior)));
        }
        modes.retain(|mode| mode.chi2 <= CHI2_MAX);
        let better = modes.iter().filter(|mode| mode.fit > fit + BETTER_MIN);
        let best = better.max_by(|a, b| a.fit.total_cmp(&b.fit));
        let (pose, chi2) = best.map_or((found, chi2), |best| (best.pose, best.chi2));
        let rivals = modes
            .iter()
            .filter(|mode| is_elsewhere(&mode.pose, &pose) && mode.chi2 <= chi2 + CHI2_MARGIN);
        let rival = rivals.map(|mode| mode.fit).fold(0.0, f64::max);
        if best.is_some() {
            *closure = self.measure(
                [closure.older, closure.newer],
                &[pose],
                closure.origin,
                keyframes,
            );
            closure.weigh(prior);
        }
        closure.scores.rival = Some(scores.rival.unwrap_or(0.0).max(rival));
    }
}

impl Mode {
    fn new(registered: &Registration, prior: &Prior) -> Self {
        let pose = registered.submap_from_query;
        let covariance = registered.information.try_inverse();
        Self {
            pose,
            fit: registered.fit(),
            chi2: covariance.map_or(f64::INFINITY, |c| prior.chi2(&pose, &c)),
        }
    }
}

/// Whether one of two poses makes a false loop of the other.
fn is_elsewhere(a: &Pose2, b: &Pose2) -> bool {
    let off = deviation(a, b);
    off.xy().norm() > FALSE_M || off.z.abs() > FALSE_RAD
}

/// Poses through one that was found, along the direction of the position that the estimate knows
/// least, as far as the estimate reaches; the heading turns as the covariance has it.
fn line(found: &Pose2, prior: &Prior, step_m: f64) -> Vec<Pose2> {
    let covariance = &prior.covariance;
    let (sin, cos) = sin_cos(0.5 * atan2(2.0 * covariance.m12, covariance.m11 - covariance.m22));
    let along = Vector3::new(cos, sin, 0.0);
    let shared = covariance * along;
    let variance = along.dot(&shared);
    if !(variance > 0.0 && step_m > 0.0) {
        return Vec::new();
    }
    let turn_rad_m = shared.z / variance;
    // The line is centred on the estimate and passes through what was found.
    let middle = (deviation(&prior.older_from_newer, found).dot(&along) / step_m).round();
    let reach = (REACH_DEVIATIONS * variance.sqrt() / step_m)
        .ceil()
        .min(STEPS_MAX);
    let steps = -(reach as i32)..=reach as i32;
    let pose = |step: i32| {
        let at_m = (middle + f64::from(step)) * step_m;
        found.compose(&Pose2::new(at_m * cos, at_m * sin, at_m * turn_rad_m))
    };
    steps.map(pose).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn a_line_follows_what_the_estimate_knows_least_from_end_to_end() {
        // 2 m along y, and a heading that turns by 0.1 rad for each of them.
        let mut covariance = Matrix3::from_diagonal(&[0.04, 4.0, 0.05].into());
        (covariance.m23, covariance.m32) = (0.4, 0.4);
        let prior = Prior {
            older_from_newer: Pose2::new(1.0, 3.0, 0.0),
            covariance,
        };
        let found = Pose2::new(1.1, 2.0, 0.0);
        let line = line(&found, &prior, 0.5);
        assert_eq!(line.len(), 25);
        assert!(line.contains(&found));
        let ends = [line[0], line[24]];
        let [low, high] = if ends[0].y_m < ends[1].y_m {
            ends
        } else {
            [ends[1], ends[0]]
        };
        // Three deviations to either side of the estimate, through what was found.
        assert!((low.y_m + 3.0).abs() < 1e-9 && (high.y_m - 9.0).abs() < 1e-9);
        assert!((low.x_m - 1.1).abs() < 1e-9 && (high.x_m - 1.1).abs() < 1e-9);
        assert!((high.yaw_rad - 0.7).abs() < 1e-9, "{high:?}");
    }

    #[test]
    fn an_estimate_without_extent_has_no_line() {
        let prior = Prior {
            older_from_newer: Pose2::IDENTITY,
            covariance: Matrix3::zeros(),
        };
        assert!(line(&Pose2::IDENTITY, &prior, 0.5).is_empty());
    }
}
