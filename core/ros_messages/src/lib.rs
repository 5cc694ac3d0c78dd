//! Our messages as ROS's, in both of its serialisations.
//!
//! Responsible for what a message of ROS holds and how it is written, not for when one goes, nor
//! for files. Pure: the same messages give the same bytes.

mod cloud;
mod definition;
mod diagnostics;
mod graph;
mod imu;
mod marker;
mod occupancy_grid;
mod odometry;
mod path;
mod pen;
mod pose_array;
mod transform;
mod trigger;

pub use cloud::{CLOUD, cloud, directions};
pub use definition::Definition;
pub use diagnostics::{DIAGNOSTICS, diagnostics};
pub use graph::{Gid, participant_entities};
pub use imu::{IMU_SAMPLE, imu_sample};
pub use marker::{MARKERS, Marker, Shape, markers};
pub use occupancy_grid::{Cells, OCCUPANCY_GRID, occupancy_grid};
pub use odometry::{ODOMETRY, POSE, odometry, pose_stamped};
pub use path::{PATH, path};
pub use pen::{Style, time};
pub use pose_array::{POSE_ARRAY, pose_array};
pub use transform::{TRANSFORMS, Transform, transforms};
pub use trigger::trigger_response;

use randt_geometry::Quaternion;

/// Frames of REP-105.
pub const MAP: &str = "map";
/// The frame that never jumps.
pub const ODOM: &str = "odom";
/// The robot.
pub const BASE_LINK: &str = "base_link";
/// Where the radar sits.
pub const RADAR: &str = "radar";
/// Where the IMU sits.
pub const IMU: &str = "imu";

/// A quaternion x, y, z, w of a turn in the plane.
pub fn about_z(yaw_rad: f64) -> [f64; 4] {
    let [w, x, y, z] = Quaternion::from_roll_pitch_yaw(0.0, 0.0, yaw_rad).to_array();
    [x, y, z, w]
}
