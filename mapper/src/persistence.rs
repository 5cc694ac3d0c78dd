//! What outlives the mapper's process: the journal of keyframes, snapshots of the map, and the way
//! back from both.

pub mod journal;
mod restore;
mod snapshot;

pub use restore::{Recalled, Restored, SnapshotRejection};
pub use snapshot::Known;
