//! The recorder: every topic into MCAP files, on a disk that may stall, fill up, break or vanish.
//!
//! Responsible for three promises: nothing older than about a second is ever lost, what is not
//! recorded is counted, and no disk ever holds the pipeline up. The stage's thread copies messages
//! into a [`Queue`], a thread of its own brings them to the disk. Not responsible for the
//! container (`randt-log`).

mod continuity;
mod disk;
mod drops;
mod metadata;
mod open_log;
#[cfg(feature = "runtime")]
mod position_store;
mod positions;
mod queue;
mod raw;
mod recorder;
#[cfg(feature = "runtime")]
pub mod runtime;
mod settings;
mod sink;
mod viewer;
mod worker;

pub use continuity::{Continuity, Gap};
pub use disk::Disk;
pub use drops::Drops;
pub use metadata::{
    CLOCK_METADATA, LAYOUTS_METADATA, MACHINE_METADATA, VERSIONS_METADATA, configuration_records,
    fields, machine_record,
};
#[cfg(feature = "runtime")]
pub use position_store::PositionStore;
pub use positions::Positions;
pub use queue::{BUDGET, Queue};
pub use raw::Raw;
pub use recorder::{Metadata, Outage, Preamble, Recorder, SYNC_NS, Settings};
pub use sink::Sink;
pub use viewer::Viewer;
pub use worker::{Worker, WorkerStatus};
