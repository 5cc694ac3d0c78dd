//! `FrameTransforms`: how the frames lie in each other.

use crate::{BASE_LINK, IMU, MAP, ODOM, RADAR, pose_of, timestamp};
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
    let mut frames = mounting(robot, stamp_ns);
    let odometry = planar(ODOM, BASE_LINK, state.pose, stamp_ns);
    frames.transforms.push(odometry);
    // As it holds at that instant.
    let correction = correction.map(|found| planar(MAP, ODOM, found.map_from_odom, stamp_ns));
    frames.transforms.extend(correction);
    frames
}

/// Where the sensors sit in `base_link` alone, while the robot's pose is unknown.
pub fn mounting(robot: &Robot, stamp_ns: i64) -> FrameTransforms {
    let radar = [robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad];
    let [w, x, y, z] = randt_geometry::Quaternion::from_roll_pitch_yaw(
        robot.imu_roll_rad,
        robot.imu_pitch_rad,
        robot.imu_yaw_rad,
    )
    .to_array();
    let mut imu = planar(BASE_LINK, IMU, [0.0; 3], stamp_ns);
    imu.rotation = Some(Quaternion { x, y, z, w });
    let transforms = vec![planar(BASE_LINK, RADAR, radar, stamp_ns), imu];
    FrameTransforms { transforms }
}

fn planar(parent: &str, child: &str, pose: [f64; 3], stamp_ns: i64) -> FrameTransform {
    let pose = pose_of(pose);
    FrameTransform {
        timestamp: timestamp(stamp_ns),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: pose.position,
        rotation: pose.orientation,
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
