//! `nav_msgs/Odometry` and `geometry_msgs/PoseStamped`: the live pose in `odom`.

use crate::definition::{Definition, POINT, POSE_INSIDE, QUATERNION, VECTOR};
use crate::pen::{Pen, Style};
use crate::{BASE_LINK, ODOM};
use randt_geometry::elementary::sin_cos;
use randt_messages::OdometryState;

/// Type of [`odometry`].
pub const ODOMETRY: Definition = Definition {
    package: "nav_msgs",
    name: "Odometry",
    md5: "cd5e73d190d741a2f92e81eda573aca7",
    text: "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    inside: &[
        "geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n",
        POSE_INSIDE,
        POINT,
        QUATERNION,
        "geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n",
        "geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        VECTOR,
    ],
};

/// Type of [`pose_stamped`].
pub const POSE: Definition = Definition {
    package: "geometry_msgs",
    name: "PoseStamped",
    md5: "d3812c3cbc69362b77dc0b19b345f8f5",
    text: "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    inside: &[POSE_INSIDE, POINT, QUATERNION],
};

/// Variance of what is not estimated: as odometry gives it where there is no pose.
const UNKNOWN: f64 = 1e6;

/// A state with its velocity and the covariance of its pose. The velocity's is not published, so
/// it is as large as what is not known.
pub fn odometry(style: Style, state: &OdometryState) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(state.id, state.header.stamp_ns, ODOM);
    pen.string(BASE_LINK);
    pen.pose(state.pose);
    let [_, _, yaw_rad] = state.pose;
    pen.f64s(&in_six(&in_odom(&state.covariance, yaw_rad)));
    let [forward, left, rate] = state.velocity;
    pen.f64s(&[forward, left, 0.0, 0.0, 0.0, rate]);
    let unknown = [UNKNOWN, 0.0, 0.0, 0.0, UNKNOWN, 0.0, 0.0, 0.0, UNKNOWN];
    pen.f64s(&in_six(&unknown));
    pen.end()
}

/// `base_link` in `odom` at the sweep's end.
pub fn pose_stamped(style: Style, state: &OdometryState) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(state.id, state.header.stamp_ns, ODOM);
    pen.pose(state.pose);
    pen.end()
}

/// A covariance of x, y, yaw in the robot's axes in those of the frame in which it looks by a yaw.
fn in_odom(covariance: &[f64; 9], yaw_rad: f64) -> [f64; 9] {
    let (s, c) = sin_cos(yaw_rad);
    let [xx, xy, xa, _, yy, ya, _, _, aa] = *covariance;
    let turned_xx = c * c * xx - 2.0 * s * c * xy + s * s * yy;
    let turned_yy = s * s * xx + 2.0 * s * c * xy + c * c * yy;
    let turned_xy = s * c * (xx - yy) + (c * c - s * s) * xy;
    let (turned_xa, turned_ya) = (c * xa - s * ya, s * xa + c * ya);
    [
        turned_xx, turned_xy, turned_xa, turned_xy, turned_yy, turned_ya, turned_xa, turned_ya, aa,
    ]
}

/// A covariance of x, y, yaw as ROS has it: x, y, z and three rotations. What lies out of the
/// plane is not estimated.
fn in_six(covariance: &[f64; 9]) -> [f64; 36] {
    const INDICES: [usize; 3] = [0, 1, 5];
    let mut six = [0.0; 36];
    for diagonal in [2, 3, 4] {
        if let Some(to) = six.get_mut(7 * diagonal) {
            *to = UNKNOWN;
        }
    }
    for (row, to_row) in INDICES.iter().enumerate() {
        for (column, to_column) in INDICES.iter().enumerate() {
            let from = covariance.get(3 * row + column);
            if let (Some(to), Some(from)) = (six.get_mut(6 * to_row + to_column), from) {
                *to = *from;
            }
        }
    }
    six
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    #[test]
    fn what_the_robot_does_not_know_ahead_it_does_not_know_along_the_axis_that_it_faces() {
        let [xx, xy, xa, yy, ya, aa] = [4.0, 0.5, 0.1, 1.0, 0.2, 0.01];
        let ahead = [xx, xy, xa, xy, yy, ya, xa, ya, aa];
        assert_eq!(in_odom(&ahead, 0.0), ahead);
        let left = in_odom(&ahead, FRAC_PI_2);
        let expected = [yy, -xy, -ya, -xy, xx, xa, -ya, xa, aa];
        for (found, expected) in left.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{left:?}");
        }
        let six = in_six(&ahead);
        assert_eq!(
            (six[0], six[1], six[5], six[6], six[7]),
            (xx, xy, xa, xy, yy)
        );
        assert_eq!((six[11], six[30], six[31], six[35]), (ya, xa, ya, aa));
        assert_eq!([six[14], six[21], six[28]], [UNKNOWN; 3]);
    }
}
