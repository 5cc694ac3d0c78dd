//! `PoseInFrame`: where the robot is, live.

use crate::{ODOM, pose_of, timestamp};
use foxglove::messages::PoseInFrame;
use randt_messages::OdometryState;

/// `base_link` in `odom` at the sweep's end.
pub fn of_state(state: &OdometryState) -> PoseInFrame {
    PoseInFrame {
        timestamp: timestamp(state.header.stamp_ns),
        frame_id: ODOM.to_owned(),
        pose: Some(pose_of(state.pose)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_a_pose_in_odom() {
        let mut state = OdometryState::default();
        state.header.stamp_ns = 12_345_678_901;
        state.pose = [1.0, -2.0, core::f64::consts::PI];
        let pose = of_state(&state);
        let stamp = pose.timestamp.unwrap();
        assert_eq!((stamp.sec(), stamp.nsec()), (12, 345_678_901));
        let inner = pose.pose.unwrap();
        assert_eq!(inner.position.unwrap().y, -2.0);
        assert!((inner.orientation.unwrap().z - 1.0).abs() < 1e-12);
    }
}
