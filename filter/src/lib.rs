//! radar/scan to radar/points, and the attitude filter.
//!
//! Responsible for what is done sweep by sweep or sample by sample, before any estimation: the beam-wise
//! cluster filter, the attitude from gyro and accelerometer, and the detection of standstill with the gyro
//! bias that it shows. Not responsible for the pose, nor for owning the bias: odometry does (DESIGN).
//! No I/O, no clock, no thread, no randomness.

mod cluster;

pub use cluster::ClusterFilter;
