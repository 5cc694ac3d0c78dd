//! The process shell between two processes of one machine. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test reports a failure by panicking"
)]

mod support;

mod descriptor;
mod history;
mod layout;
mod loan;
#[cfg(target_os = "linux")]
mod slots;
#[cfg(target_os = "linux")]
mod strangers;
#[cfg(target_os = "linux")]
mod user;
