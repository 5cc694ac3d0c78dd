//! What outlives a process: records, keyframes and files that are mapped into memory.

mod checkpoint;
mod keyframe_ring;
mod mapped_file;

pub use checkpoint::Checkpoint;
pub use keyframe_ring::KeyframeRing;
pub use mapped_file::FileBytes;
