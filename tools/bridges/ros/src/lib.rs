//! Between the pipeline's topics and those of ROS.
//!
//! Responsible for what each message of ROS becomes here and the other way round, not for how it
//! comes and goes: that is each bridge's own.

mod inward;
mod outward;

pub use inward::Inward;
pub use outward::{Kept, Outward};
