//! The process shell: what makes a stage's algorithm a process of the pipeline.
//!
//! Responsible for shared-memory ports and their quality of service, the wait loop, signals, loss counters, health,
//! the one clock, state that outlives a process, and what systemd is told. The only crate that knows iceoryx2. Not responsible for what a
//! stage computes: the algorithms do not know this crate, their `main.rs` brings both together.
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
mod bus;
mod checkpoint;
mod clock;
mod dead_node_cleanup;
mod documents;
mod domain;
mod error;
mod exhausted;
mod exit;
mod health;
mod held;
mod journal;
mod keyframes;
mod leftovers;
mod locks;
mod mapped;
mod memory;
mod memory_watch;
mod node_count;
mod node_files;
mod notify;
mod observer;
mod parent;
mod ports;
mod preallocation;
mod priority;
mod private_folder;
mod publisher;
mod qos;
mod registry;
mod reload;
mod rights;
mod service_slots;
mod stage;
mod status;
mod subscriber;
mod supervised;
mod wait;
mod wire;

pub use arguments::{DomainArguments, StageArguments};
pub use checkpoint::Checkpoint;
pub use clock::Clock;
pub use dead_node_cleanup::{CleanUp, clean_up, slots_of_nobody};
pub use documents::parse;
pub use domain::Domain;
pub use error::Error;
pub use exit::ended;
pub use keyframes::KeyframeRing;
pub use leftovers::{Leftover, leftovers, wipe};
pub use locks::Presence;
pub use mapped::FileBytes;
pub use memory_watch::memory_gone;
pub use observer::{Observer, stop_requested};
pub use parent::end_with;
pub use priority::go_behind;
pub use publisher::{Loan, Publisher};
pub use qos::{Qos, TOPICS};
pub use registry::{Entry, Registry};
pub use rights::{Exposed, exposed};
pub use stage::Stage;
pub use subscriber::{Received, Subscriber};
pub use wait::{Descriptor, Waitable, WakeReason};
