//! odometry/keyframe to loops, pose graph and occupancy grid.
//!
//! Responsible for the global map: which keyframes are of one spot, where every keyframe is once
//! that is known, and the grid to navigate by; and for coming back with the same map after a kill.
//! Not responsible for the live pose (odometry) nor for carrying messages.
//!
//! [`Mapper`] is composed of a keyframe store, place recognition, loop verification, the pose
//! graph and the occupancy grid, each in a folder of its name; `persistence` is what outlives the
//! process. A struct with `push` methods: no I/O, no clock, no thread, no randomness; only
//! [`journal::JournalFile`] touches a file.
//!
//! ```
//! use randt_config::Config;
//! use randt_mapper::{ComponentIdx, KeyframeIdx, Mapper};
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
//! assert_eq!(mapper.component_of(KeyframeIdx(2)), ComponentIdx(0));
//! ```

mod index;
mod keyframe;
mod known_ground;
mod mapper;
pub mod occupancy;
mod persistence;
mod place_recognition;
pub mod pose_graph;
pub mod publication;
mod verification;

pub use index::{ClosureIdx, ComponentIdx, KeyframeIdx};
pub use keyframe::{LazyObservation, MapKeyframe, Observation};
pub use mapper::{Counters, Mapper, SECTIONS};
pub use persistence::{Known, Recalled, Restored, SnapshotRejection, journal};
pub use place_recognition::{
    CandidateOrigin, Likeness, LoopCandidate, PlaceRecognition, RingKey, ScanContext,
};
pub use verification::{
    LoopClosure, LoopStatus, QuerySubmap, Registrar, Registration, Scores, Submaps,
};
