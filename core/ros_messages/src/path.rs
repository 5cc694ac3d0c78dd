//! `nav_msgs/Path`: the keyframes' poses in `map`.

use crate::MAP;
use crate::definition::{Definition, POINT, POSE_INSIDE, QUATERNION};
use crate::pen::{Pen, Style};

/// Its type.
pub const PATH: Definition = Definition {
    package: "nav_msgs",
    name: "Path",
    md5: "6227e2b7e9cce15051f669a5e197bbf7",
    text: "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
    inside: &[
        "geometry_msgs/PoseStamped\nstd_msgs/Header header\ngeometry_msgs/Pose pose\n",
        POSE_INSIDE,
        POINT,
        QUATERNION,
    ],
};

/// Stamps and poses (x m, y m, yaw rad), in their order.
pub fn path(style: Style, stamp_ns: i64, poses: &[(i64, [f64; 3])]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(0, stamp_ns, MAP);
    pen.u32(poses.len() as u32);
    for (stamp_ns, pose) in poses {
        pen.header(0, *stamp_ns, MAP);
        pen.pose(*pose);
    }
    pen.end()
}
