//! `tf2_msgs/TFMessage`: how frames lie in each other.

use crate::definition::{Definition, QUATERNION, VECTOR};
use crate::pen::{Pen, Style};
use crate::{BASE_LINK, IMU, MAP, ODOM, RADAR, about_z};
use randt_messages::{Correction, OdometryState};

/// Its type.
pub const TRANSFORMS: Definition = Definition {
    package: "tf2_msgs",
    name: "TFMessage",
    md5: "94810edda583a504dfda3829e70d7eec",
    text: "geometry_msgs/TransformStamped[] transforms\n",
    inside: &[
        "geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        "geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        VECTOR,
        QUATERNION,
    ],
};

/// A frame in another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    parent: &'static str,
    child: &'static str,
    position_m: [f64; 2],
    /// Quaternion x, y, z, w.
    rotation: [f64; 4],
}

impl Transform {
    /// Where the sensors sit: the radar by x m, y m, yaw rad, the IMU by a quaternion w, x, y, z.
    pub fn mounting(radar: [f64; 3], [w, x, y, z]: [f64; 4]) -> [Self; 2] {
        let imu = Self {
            rotation: [x, y, z, w],
            ..Self::planar(BASE_LINK, IMU, [0.0; 3])
        };
        [Self::planar(BASE_LINK, RADAR, radar), imu]
    }

    /// The robot in `odom`.
    pub fn odometry(state: &OdometryState) -> Self {
        Self::planar(ODOM, BASE_LINK, state.pose)
    }

    /// `odom` in `map`.
    pub fn correction(correction: &Correction) -> Self {
        Self::planar(MAP, ODOM, correction.map_from_odom)
    }

    fn planar(parent: &'static str, child: &'static str, [x_m, y_m, yaw_rad]: [f64; 3]) -> Self {
        Self {
            parent,
            child,
            position_m: [x_m, y_m],
            rotation: about_z(yaw_rad),
        }
    }
}

/// Transforms as they hold at an instant.
pub fn transforms(style: Style, stamp_ns: i64, transforms: &[Transform]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.u32(transforms.len() as u32);
    for transform in transforms {
        pen.header(0, stamp_ns, transform.parent);
        pen.string(transform.child);
        let [x_m, y_m] = transform.position_m;
        pen.f64s(&[x_m, y_m, 0.0]);
        pen.f64s(&transform.rotation);
    }
    pen.end()
}
