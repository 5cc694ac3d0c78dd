//! Whether the radar sits where it is configured, by how `base_link` moves in turns and straights.

use crate::sliding_window::WindowScan;
use nalgebra::{Matrix2, Vector2, Vector3};
use randt_geometry::Pose2;
use randt_persist::persist;

/// Steps of scans that are next to each other share their errors: that many count as one.
const CORRELATED: f64 = 10.0;
/// What has to be driven, m, and turned in all, rad (a turn and a half), before anything is said.
const PATH_MIN_M: f64 = 20.0;
const TURNED_MIN_RAD: f64 = 9.4;
/// Offsets that are said: sound drives show at most 0.03 m and 0.5 degrees, and a map is none the
/// worse for less, m and rad (2 degrees).
const OFFSET_MIN_M: f64 = 0.1;
const YAW_MIN_RAD: f64 = 0.035;
/// ... where they are that many standard deviations.
const SIGMAS: f64 = 5.0;

/// What has to be added to the configured mounting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountingOffset {
    /// To the radar's place ahead of `base_link`, m; 0 where it is right.
    pub forward_m: f64,
    /// To the radar's yaw, rad; 0 where it is right.
    pub yaw_rad: f64,
}

/// Follows how far `base_link` moves sideways: what turns on wheels does so only by an error of the
/// mounting. A radar that sits farther ahead swings it to the side in turns, one that is turned
/// lets it drift sideways in straights: the statistic of `randt calibrate extrinsics`, from any
/// drive.
///
/// Its least squares are of the way sideways by the turn and the way ahead.
#[derive(Clone, Copy, Debug, Default)]
pub struct MountingCheck {
    steps: f64,
    information: Matrix2<f64>,
    gradient: Vector2<f64>,
    sideways_m2: f64,
    path_m: f64,
    turned_rad: f64,
}

persist!(MountingCheck {
    steps,
    information,
    gradient,
    sideways_m2,
    path_m,
    turned_rad,
});

impl MountingCheck {
    /// Takes the final step to a scan, where that is believed and sees every direction.
    pub fn observe(&mut self, scan: &WindowScan, last_from_base: &Pose2) {
        if scan.is_sure() {
            self.push(last_from_base.log());
        }
    }

    /// A step in `base_link`: ahead and to the left, m, and its turn, rad.
    fn push(&mut self, step: Vector3<f64>) {
        let (ahead_m, left_m, turn_rad) = (step.x, step.y, step.z);
        let by = Vector2::new(turn_rad, ahead_m);
        self.steps += 1.0;
        self.information += by * by.transpose();
        self.gradient += by * left_m;
        self.sideways_m2 += left_m * left_m;
        self.path_m += ahead_m.abs();
        self.turned_rad += turn_rad.abs();
    }

    /// Steps that were taken.
    pub fn scans(&self) -> u64 {
        self.steps as u64
    }

    /// What has to be added to the mounting, where the drive shows it.
    pub fn offset(&self) -> Option<MountingOffset> {
        if self.path_m < PATH_MIN_M || self.turned_rad < TURNED_MIN_RAD {
            return None;
        }
        let covariance = self.information.try_inverse()?;
        let found = covariance * self.gradient;
        let left_m2 = (self.sideways_m2 - found.dot(&self.gradient)).max(0.0);
        let variance_m2 = left_m2 * CORRELATED / self.steps;
        let shown = |axis: usize, least: f64| {
            let value = found[axis];
            let sigma = (variance_m2 * covariance[(axis, axis)]).sqrt();
            let is_shown = value.abs() > least && value.abs() > SIGMAS * sigma;
            is_shown.then_some(value)
        };
        let (forward_m, yaw_rad) = (shown(0, OFFSET_MIN_M), shown(1, YAW_MIN_RAD));
        (forward_m.is_some() || yaw_rad.is_some()).then(|| MountingOffset {
            forward_m: forward_m.unwrap_or_default(),
            // A radar that is turned to the left sees the robot drift to the right.
            yaw_rad: -yaw_rad.unwrap_or_default(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::sin;

    /// A drive in curves to both sides with a wrong mounting, which moves `base_link`, and an error
    /// of up to a centimetre from scan to scan.
    fn driven(scans: u32, true_from_configured: Pose2) -> Option<MountingOffset> {
        let mut check = MountingCheck::default();
        let mut random = 1_u32;
        let mut noise = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (f64::from(random >> 8) / f64::from(1_u32 << 24) - 0.5) * 0.02
        };
        let back = true_from_configured.inverse();
        for number in 0..scans {
            let turn_rad = 0.1 * sin(0.05 * f64::from(number));
            let step = Pose2::exp(Vector3::new(0.12, 0.0, turn_rad));
            let seen = back.compose(&step).compose(&true_from_configured).log();
            check.push(seen + Vector3::new(noise(), noise(), 0.1 * noise()));
        }
        check.offset()
    }

    #[test]
    fn a_radar_that_sits_elsewhere_is_shown_by_turns_and_straights() {
        assert_eq!(driven(800, Pose2::IDENTITY), None);
        assert_eq!(driven(800, Pose2::new(0.05, 0.3, 0.01)), None);
        // `base_link` by the wrong mounting lies that far ahead of the true one.
        let offset = driven(800, Pose2::new(0.3, 0.0, 0.0)).unwrap();
        assert!((offset.forward_m - 0.3).abs() < 0.02, "{offset:?}");
        assert_eq!(offset.yaw_rad, 0.0);
        let offset = driven(800, Pose2::new(0.0, 0.0, 0.1)).unwrap();
        assert!((offset.yaw_rad - 0.1).abs() < 0.01, "{offset:?}");
        assert_eq!(offset.forward_m, 0.0);
        // Too little was driven.
        assert_eq!(driven(100, Pose2::new(0.3, 0.0, 0.0)), None);
    }
}
