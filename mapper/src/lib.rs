//! odometry/keyframe to loops, pose graph and occupancy grid.
//!
//! Responsible for the global map: which places are the same, where every keyframe stands once that is known, and
//! the grid to navigate by. Not responsible for the live pose (odometry) nor for carrying messages. A struct with
//! `push` methods: no I/O, no clock, no thread, no randomness.

mod candidate;
mod divergence;
pub mod graph;
pub mod grid;
mod mapper;
mod place;
mod registration;
mod scan_context;
mod search;
mod submap;
mod verify;

pub use candidate::{Candidate, Fate, Scores};
pub use mapper::{Counters, Mapper};
pub use place::Place;
pub use scan_context::{Likeness, ScanContext};
pub use search::Source;
