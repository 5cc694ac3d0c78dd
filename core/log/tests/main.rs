//! Logs as they are written and read. One program, so that it is linked once.
// Helpers of tests may unwrap; clippy only knows #[test] functions themselves.
#![allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]

mod kept_logs;
mod log;
mod other_builds;
mod renamed_fields;
