//! odometry/keyframe to loops, pose graph and occupancy grid.
//!
//! Responsible for the global map: which places are the same, where every keyframe stands once that is known, and
//! the grid to navigate by. Not responsible for the live pose (odometry) nor for carrying messages. A struct with
//! `push` methods: no I/O, no clock, no thread, no randomness.

pub mod graph;
