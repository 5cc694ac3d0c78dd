//! Calibration of radar against gyro and robot from one drive: time offset, mounting yaw, lever
//! arm.
//!
//! Responsible for the estimates, their uncertainties, and for refusing what a drive did not show.
//! Not responsible for reading logs nor for the radar's path through them, which is odometry's. No
//! I/O, no clock, no randomness.

mod error;
mod estimate;
mod gyro;
mod motion;
mod mounting;
mod offset;
mod pivot;
mod stretch;
mod yaw;

pub use error::Unobservable;
pub use estimate::Estimate;
pub use gyro::{Gyro, YawRate};
pub use motion::{RadarPose, Span};
pub use mounting::{LeverArm, Mounting, mounting};
pub use offset::{TimeOffset, time_offset};
pub use pivot::Pivot;
pub use yaw::MountingYaw;
