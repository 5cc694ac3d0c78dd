//! `geometry_msgs/PoseArray`: poses in `map`, without their instants.

use crate::MAP;
use crate::definition::{Definition, POINT, POSE_INSIDE, QUATERNION};
use crate::pen::{Pen, Style};

/// Its type.
pub const POSE_ARRAY: Definition = Definition {
    package: "geometry_msgs",
    name: "PoseArray",
    md5: "916c28c5764443f268b296bb671b9d97",
    text: "std_msgs/Header header\ngeometry_msgs/Pose[] poses\n",
    inside: &[POSE_INSIDE, POINT, QUATERNION],
};

/// Poses x m, y m, yaw rad, in their order.
pub fn pose_array(
    style: Style,
    stamp_ns: i64,
    poses: impl ExactSizeIterator<Item = [f64; 3]>,
) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(0, stamp_ns, MAP);
    pen.u32(poses.len() as u32);
    for pose in poses {
        pen.pose(pose);
    }
    pen.end()
}
