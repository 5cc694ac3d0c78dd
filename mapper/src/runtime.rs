//! What makes the mapper a process: keyframes into journal and map, the map to its readers.

mod checkpoint_store;
mod disk_thread;
mod journal_writer;
mod keyframe_ingest;
mod keyframe_sequence;
mod map_publisher;
mod replay_queue;

pub use keyframe_ingest::KeyframeIngest;
pub use map_publisher::MapPublisher;
