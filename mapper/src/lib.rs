//! odometry/keyframe to loops, pose graph and occupancy grid.
//!
//! Responsible for the global map: which places are the same, where every keyframe stands once that is known, and
//! the grid to navigate by; and for coming back with the same map after a kill. Not responsible for the live pose (odometry)
//! nor for carrying messages. A struct with `push` methods: no I/O, no clock, no thread, no randomness; only
//! [`journal::JournalFile`] touches a file.
//!
//! ```
//! use randt_config::Config;
//! use randt_mapper::Mapper;
//! use randt_messages::{Keyframe, Message};
//!
//! let mut mapper = Mapper::new(&Config::default());
//! let mut keyframe = Message::<Keyframe>::default();
//! for id in 0..3 {
//!     keyframe.head.id = id;
//!     keyframe.head.header.stamp_ns = id as i64 * 1_000_000_000;
//!     keyframe.head.pose = [0.5 * id as f64, 0.0, 0.0];
//!     mapper.push(keyframe.as_ref());
//! }
//! mapper.finish();
//! assert_eq!(mapper.poses().len(), 3);
//! assert_eq!(mapper.part_of(2), 0);
//! ```

mod candidate;
mod divergence;
pub mod graph;
pub mod grid;
pub mod journal;
mod mapper;
mod place;
mod plain;
pub mod publication;
mod registration;
mod scan_context;
mod search;
mod sight;
mod submap;
mod verify;

pub use candidate::{Candidate, Fate, Scores};
pub use mapper::{Counters, Known, Mapper, PassedOver, Recalled, Restored, SECTIONS};
pub use place::Place;
pub use registration::{Registrar, Registration};
pub use scan_context::{Likeness, RingKey, ScanContext};
pub use search::{Lead, Search, Source};
pub use sight::{LazySight, Sight};
pub use submap::{Submaps, Trail};
