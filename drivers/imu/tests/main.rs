//! IMUs behind emulated devices. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test reports failures by panicking"
)]

mod support;

mod lines;
mod serial;
mod vendor_library;
