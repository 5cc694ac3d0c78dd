//! The recorder without a bus, on disks that fail. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test reports failures by panicking"
)]

mod support;

mod disks;
mod power;
