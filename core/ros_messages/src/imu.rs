//! `sensor_msgs/Imu`.

use crate::IMU;
use crate::definition::{Definition, QUATERNION, VECTOR};
use crate::pen::{Pen, Style};
use randt_messages::ImuSample;

/// Its type.
pub const IMU_SAMPLE: Definition = Definition {
    package: "sensor_msgs",
    name: "Imu",
    md5: "6a62c6daae103f4ff57a132d6f95cec2",
    text: "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    inside: &[QUATERNION, VECTOR],
};

/// A sample: without orientation, and with covariances that are not known.
pub fn imu_sample(style: Style, sample: &ImuSample) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(sample.header.sequence, sample.header.stamp_ns, IMU);
    // A first covariance of -1 means that there is no orientation, covariances of 0 that they are
    // not known (sensor_msgs/Imu).
    pen.f64s(&[0.0; 4]);
    pen.f64s(&[-1.0]);
    pen.f64s(&[0.0; 8]);
    pen.f64s(&sample.rate_rad_s);
    pen.f64s(&[0.0; 9]);
    pen.f64s(&sample.acceleration_m_s2);
    pen.f64s(&[0.0; 9]);
    pen.end()
}
