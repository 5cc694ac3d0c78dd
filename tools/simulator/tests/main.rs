//! Simulated worlds, drives and sensors. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test reports failures by panicking"
)]

mod drive;
mod room;
mod worlds;
