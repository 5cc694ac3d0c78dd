//! radar/scan to radar/points, and the attitude filter.
//!
//! Responsible for what is done sweep by sweep or sample by sample, before any estimation: the
//! beam-wise cluster filter, the attitude from gyro and accelerometer, and the detection of
//! standstill with the gyro bias that it shows. Not responsible for the pose, nor for the estimate
//! of the bias in force: odometry owns both. No I/O, no clock, no thread, no randomness.

mod attitude;
mod bias;
mod clock;
mod cluster;
mod fit;
mod mounting;
mod standstill;
mod statistics;

pub use attitude::AttitudeFilter;
pub use bias::GyroBias;
pub use clock::{Pace, SampleClock};
pub use cluster::{ClusterFilter, FilteredSweep};
pub use fit::check_sweep;
pub use mounting::{Mounting, MountingCheck, MountingResult};
pub use standstill::{Standstill, StandstillBias};
