//! The process shell: what makes a stage's algorithm a process of the pipeline.
//!
//! Responsible for the domain (which processes see each other), ports over shared memory and their
//! quality of service, the wait loop, signals, health, the one clock, state that outlives a
//! process, the memory that all of this shares, and what systemd and the journal are sent. The
//! only crate that knows iceoryx2. Not responsible for what a stage computes: the algorithms do
//! not know this crate, their `main.rs` brings both together.
//!
//! ```no_run
//! use randt_messages::{ImuSampleTopic, OdometryStateTopic};
//! use randt_stage::{Domain, Stage, WakeReason};
//!
//! let mut stage = Stage::open("example", &Domain::new("randt", None)?)?;
//! let mut samples = stage.subscriber::<ImuSampleTopic>()?;
//! stage.running()?;
//! while stage.wait(&[&samples], None)? != WakeReason::Stop {
//!     while let Some(sample) = samples.receive()? {
//!         println!("{:?}", sample.message().head.rate_rad_s);
//!     }
//! }
//! # Ok::<(), randt_stage::Error>(())
//! ```

mod arguments;
mod dead_node_cleanup;
mod documents;
mod domain;
mod error;
mod memory;
mod observer;
mod persist;
mod ports;
mod stage;
mod stages;
mod supervise;

pub use arguments::{DomainArguments, StageArguments};
pub use dead_node_cleanup::{CleanUp, Leftover, clean_up, leftovers, orphaned_slots, wipe};
pub use documents::parse;
pub use domain::{Clock, Domain, Entry, Exposed, Presence, Registry, exposed};
pub use error::Error;
pub use memory::memory_gone;
pub use observer::{Observer, stop_requested};
pub use persist::{Checkpoint, FileBytes, KeyframeRing};
pub use ports::{
    Descriptor, Loan, Publisher, Received, Subscriber, Waitable, WakeReason, bytes_in_use,
};
pub use stage::Stage;
pub use stages::{COMPUTING_STAGES, STAGES};
pub use supervise::{end_with, ended, lower_priority};
