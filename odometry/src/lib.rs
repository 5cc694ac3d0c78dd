//! radar/points, imu/sample and robot/twist to odometry/state and odometry/keyframe.
//!
//! Responsible for the live pose: de-skew, sliding-window motion estimation against submaps,
//! trust, keyframes. Not responsible for loops (mapper) nor for carrying messages (core/stage,
//! tools). A struct with `push` methods: no I/O, no clock, no thread, no randomness; the same
//! scans and the same samples give the same bits, however the two interleave, and whether or not
//! the state was saved and restored in between.

mod deskew;
mod earlier_cells;
mod gravity_check;
mod gyro_check;
mod gyro_integrator;
mod gyro_measurement;
mod gyro_rates;
mod inertial_speed;
mod initializer;
mod keyframe_selector;
mod localizability;
mod mounting_check;
mod moving_clutter;
mod odometry;
mod odometry_frame;
mod recent_drift;
#[cfg(feature = "runtime")]
pub mod runtime;
mod scan;
mod scan_overlap;
mod sliding_window;
mod stamps;
mod state_publisher;
mod submaps;
mod synchronizer;
mod tilt;
mod tracking_monitor;
mod tracking_status;
mod twist_speed;

pub use gyro_check::GyroFault;
pub use gyro_rates::{GyroRates, Repeated};
pub use odometry::{Counters, Odometry, Sink};
pub use randt_persist::Error;
pub use synchronizer::MessageId;
