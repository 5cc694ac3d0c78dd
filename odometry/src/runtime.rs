//! What makes odometry a process: the checkpoints that outlive it, and the order in which it takes
//! its inputs.
//!
//! Only with the feature `process`; computing offline does not need it.

mod checkpoint_store;
mod feed;
mod outbox;

pub use checkpoint_store::{CheckpointContents, CheckpointError, CheckpointStore, RECORDS};
pub use feed::Feed;
pub use outbox::Outbox;
