//! `FrameTransforms`: how the frames lie in each other.

use crate::{BASE_LINK, IMU, MAP, ODOM, RADAR, rotation, timestamp, vector};
use foxglove::messages::{FrameTransform, FrameTransforms, Quaternion};
use randt_config::Robot;
use randt_messages::{Correction, OdometryState};

/// All frames as they lie when a state holds: where the sensors sit, `odom` to `base_link`, and
/// `map` to `odom` where the mapper has published it.
pub fn transforms(
    robot: &Robot,
    state: &OdometryState,
    correction: Option<&Correction>,
) -> FrameTransforms {
    let stamp_ns = state.header.stamp_ns;
    let mut transforms = sensors(robot, stamp_ns);
    transforms.push(of_state(state));
    transforms.extend(correction.map(|correction| of_correction(correction, stamp_ns)));
    FrameTransforms { transforms }
}

/// Where the sensors sit alone, while the robot's pose is unknown.
pub fn mounting(robot: &Robot, stamp_ns: i64) -> FrameTransforms {
    let transforms = sensors(robot, stamp_ns);
    FrameTransforms { transforms }
}

/// `odom` to `base_link`.
fn of_state(state: &OdometryState) -> FrameTransform {
    planar(ODOM, BASE_LINK, state.pose, state.header.stamp_ns)
}

/// `map` to `odom`, as it holds at an instant.
fn of_correction(correction: &Correction, stamp_ns: i64) -> FrameTransform {
    planar(MAP, ODOM, correction.map_from_odom, stamp_ns)
}

/// The sensors in `base_link`.
fn sensors(robot: &Robot, stamp_ns: i64) -> Vec<FrameTransform> {
    let radar = [robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad];
    let [w, x, y, z] = randt_geometry::Quaternion::from_roll_pitch_yaw(
        robot.imu_roll_rad,
        robot.imu_pitch_rad,
        robot.imu_yaw_rad,
    )
    .to_array();
    let mut imu = planar(BASE_LINK, IMU, [0.0; 3], stamp_ns);
    imu.rotation = Some(Quaternion { x, y, z, w });
    vec![planar(BASE_LINK, RADAR, radar, stamp_ns), imu]
}

fn planar(
    parent: &str,
    child: &str,
    [x_m, y_m, yaw_rad]: [f64; 3],
    stamp_ns: i64,
) -> FrameTransform {
    FrameTransform {
        timestamp: timestamp(stamp_ns),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(vector(x_m, y_m)),
        rotation: Some(rotation(yaw_rad)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frames_are_those_of_rep_105() {
        let robot = Robot {
            radar_x_m: 0.25,
            ..Robot::default()
        };
        let state = OdometryState::default();
        let found = transforms(&robot, &state, Some(&Correction::default())).transforms;
        let tree: Vec<_> = found
            .iter()
            .map(|t| (t.parent_frame_id.as_str(), t.child_frame_id.as_str()))
            .collect();
        let under_base = |child| (BASE_LINK, child);
        assert_eq!(
            tree,
            [
                under_base(RADAR),
                under_base(IMU),
                (ODOM, BASE_LINK),
                (MAP, ODOM)
            ]
        );
        assert_eq!(found[0].translation.unwrap().x, 0.25);
        assert_eq!(found[1].rotation.unwrap().w, 1.0);
    }
}
