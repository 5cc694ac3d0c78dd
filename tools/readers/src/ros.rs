//! ROS messages and recordings, common to ROS 1 and ROS 2.

mod cloud;
pub(crate) mod compressed;
pub(crate) mod imu;
mod imu_topic;
mod laser_scan;
mod live;
mod merged;
pub(crate) mod navtech;
pub(crate) mod polar;
mod recording;
mod source;
mod stamp_check;
mod topics;
mod transform;
pub(crate) mod twist;
mod wire;

#[cfg(test)]
pub(crate) use cloud::Point;
pub(crate) use cloud::{Cloud, UNKNOWN_INTENSITY};
pub use live::LiveRos;
pub(crate) use merged::Merged;
#[cfg(test)]
pub(crate) use recording::RadarKind;
pub(crate) use recording::{Channel, Kind, Raw, Recording};
pub(crate) use source::RosSource;
pub(crate) use transform::decode as decode_transforms;
pub use wire::Encoding;
