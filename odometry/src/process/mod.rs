//! What makes odometry a process: its past, which outlives it, and the order in which it takes what comes.
//!
//! Only with the feature `process`; whoever computes offline does without.

mod feed;
mod outbox;
mod past;

pub use feed::Feed;
pub use outbox::Outbox;
pub use past::{LeftBehind, Past, PastError, RECORDS};
