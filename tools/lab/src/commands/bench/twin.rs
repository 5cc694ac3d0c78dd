//! The undisturbed twin of a drive: the same events without a fault. What a fault does is what the
//! two differ by.

use randt::drive::Drive;
use randt::job;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::OdometryState;
use std::collections::BTreeMap;

/// A fault has an effect from this difference on, m and rad (1 degree).
const EFFECT_M: f64 = 0.2;
const EFFECT_RAD: f64 = 0.017_453;

/// Live poses of the undisturbed drive.
pub(super) struct Twin {
    /// By the scan's sequence number, with its odometry frame.
    poses: BTreeMap<u64, (u64, Pose2)>,
}

impl Twin {
    /// Computes a drive as it is.
    pub fn of_drive(drive: &Drive, config: &Config) -> anyhow::Result<Self> {
        let bar = indicatif::ProgressBar::hidden();
        let done = job::run(&mut drive.source(), config, true, &bar)?;
        Ok(Self::from_states(&done.results.states))
    }

    fn from_states(states: &[OdometryState]) -> Self {
        let pose = |state: &OdometryState| {
            let odom_from_base = Pose2::from_array(state.pose);
            (state.scan_sequence, (state.odom_frame_id, odom_from_base))
        };
        Self {
            poses: states.iter().map(pose).collect(),
        }
    }

    /// Stamp of the first scan by which the way since an instant is another one than the twin's.
    pub fn effect_ns(&self, states: &[OdometryState], from_ns: i64) -> Option<i64> {
        let later = states.partition_point(|state| state.header.stamp_ns <= from_ns);
        let begin = states.get(later.saturating_sub(1))?;
        let (twin_frame, twin_begin) = self.poses.get(&begin.scan_sequence)?;
        let odom_from_begin = Pose2::from_array(begin.pose);
        let is_off = |state: &&OdometryState| {
            let twin = self.poses.get(&state.scan_sequence);
            let Some((_, twin)) = twin.filter(|(frame, _)| frame == twin_frame) else {
                return false;
            };
            let way = odom_from_begin.between(&Pose2::from_array(state.pose));
            let error = twin_begin.between(twin).between(&way);
            error.translation().norm() > EFFECT_M || error.yaw_rad.abs() > EFFECT_RAD
        };
        let later = states.iter().skip(later);
        let mut later = later.filter(|state| state.odom_frame_id == begin.odom_frame_id);
        later.find(is_off).map(|state| state.header.stamp_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn states(yaw_rad: impl Fn(u64) -> f64) -> Vec<OdometryState> {
        let state = |number: u64| {
            let mut state = OdometryState {
                scan_sequence: number,
                ..OdometryState::default()
            };
            state.header.stamp_ns = number as i64;
            state.pose = [0.1 * number as f64, 0.0, yaw_rad(number)];
            state
        };
        (1..=20).map(state).collect()
    }

    #[test]
    fn an_effect_is_what_differs_from_the_twin_since_the_onset() {
        let twin = Twin::from_states(&states(|_| 0.0));
        assert_eq!(twin.effect_ns(&states(|_| 0.0), 0), None);
        // Half a degree at each scan from the tenth on.
        let turned = states(|number| 0.0087 * number.saturating_sub(9) as f64);
        assert_eq!(twin.effect_ns(&turned, 0), Some(12));
        // What it was off by before plays no part.
        assert_eq!(twin.effect_ns(&turned, 11), Some(14));
    }
}
