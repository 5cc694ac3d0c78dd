//! radar/points and imu/sample to odometry/state and odometry/keyframe.
//!
//! Responsible for the live pose: de-skew, sliding-window motion estimation against submaps, trust, keyframes.
//! Not responsible for loops (mapper) nor for carrying messages (core/stage, tools). A struct with `push`
//! methods: no I/O, no clock, no thread, no randomness; the same scans and the same samples give the same bits,
//! however the two interleave, and whether or not the state was saved and restored in between.

mod chain;
mod deskew;
mod factors;
mod heading;
mod imu_queue;
mod keyframe;
mod ndt_term;
mod odometry;
#[cfg(feature = "process")]
pub mod process;
mod scan;
mod slot;
mod state;
mod submap;
mod tilt;
mod trust;
mod window;

pub use odometry::{Counters, Odometry, Sink, Source};
pub use randt_persist::Error;
pub use slot::cell_rule;
