//! Recorded radar logs as our messages: folders of polar images, ROS bags, our own MCAP.
//!
//! Responsible for recognising an input by its content and for turning it into sweeps and IMU
//! samples in our frames and clock. Not responsible for how they are used.

mod counters;
mod error;
mod folders;
#[doc(hidden)]
pub mod fuzzing;
pub mod g2o;
mod input;
mod limit;
mod log;
mod log_folder;
mod merge;
mod open;
mod options;
mod polar_image;
mod ros;
mod ros1;
mod ros2;
mod summary;
mod sweep;
#[cfg(test)]
mod tests;

pub use error::Error;
pub use input::{BinSize, Counter, Extrinsics, InputInfo, InputTopic, Source};
pub use log_folder::{LogFiles, log_files};
pub use open::open;
pub use options::{Options, Rotation, StampMeaning};
pub use randt_messages::Event;
pub use ros::{Encoding, LiveRos};
