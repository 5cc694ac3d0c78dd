//! Odometry as a library, on a simulated drive. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

mod support;

mod behaviour;
mod order;
mod saved;
mod start;
