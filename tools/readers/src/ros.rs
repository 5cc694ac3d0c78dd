//! ROS messages and recordings, common to ROS 1 and ROS 2.

mod cloud;
pub(crate) mod imu;
mod recording;
mod source;
mod transform;
pub(crate) mod twist;
mod wire;

pub(crate) use cloud::Cloud;
#[cfg(test)]
pub(crate) use cloud::Point;
pub(crate) use recording::{Channel, Kind, Raw, Recording};
pub(crate) use source::RosSource;
pub(crate) use transform::decode as decode_transforms;
pub(crate) use wire::Encoding;
