//! The messages between the stages: payload types, topic names with versions, layout hash.
//!
//! Responsible for the one definition of every message, on the bus and in the log.
//! Not responsible for transport: this crate knows no shared memory, no file, no clock.
//!
//! Every payload is `repr(C)` plain old data without padding (the compiler refuses anything else).
//! Stamps are nanoseconds of one clock. Frames follow REP-103 and REP-105: x forward, y left,
//! counter-clockwise; readers and drivers turn the angles of a clockwise sensor.
//!
//! ```
//! use randt_messages::{Message, RadarScan, Return, Topic};
//!
//! let mut scan = Message::<RadarScan>::default();
//! scan.head.header.stamp_ns = 1_700_000_000_200_000_000;
//! scan.items.push(Return { range_m: 4.2, intensity: 11.0, beam: 0, bin: 260 });
//!
//! let mut bytes = Vec::new();
//! scan.as_ref().write_bytes(&mut bytes);
//! assert_eq!(Message::<RadarScan>::from_bytes(&bytes), Some(scan));
//! assert!(RadarScan::TYPE_NAME.starts_with("RadarScan-"));
//! ```

mod checkpoint;
mod drop;
mod event;
pub mod health;
mod imu;
mod keyframe;
pub mod layout;
mod mapper;
mod odometry;
mod radar;
mod topic;
mod topics;
mod trust_reason;
mod trust_text;
mod truth;
mod twist;

pub use checkpoint::{LastRecorded, PoseRecord};
pub use drop::{DropCause, LogDrop};
pub use event::Event;
pub use health::{HEALTH_PORTS, PortHealth, StageHealth, StageState};
pub use imu::ImuSample;
pub use keyframe::{KeyframeBeam, KeyframeHead, KeyframePoint};
pub use layout::Layout;
pub use mapper::{
    Correction, GRAPH_ENTRIES_MAX, GraphEntry, GraphEntryKind, GraphHead, TILE_CELLS, TileHead,
};
pub use odometry::{ImuUse, Localizability, OdometryState, Trust};
pub use radar::{
    Beam, MAX_BEAMS, MAX_RETURNS, PointsHead, Return, ScanHead, SensorKind, SweepHead,
};
pub use topic::{Message, MessageRef, Topic};
pub use topics::{
    BUS_TOPICS, BusTopic, ImuSampleTopic, Keyframe, LogDropTopic, MapperCorrection, MapperGraph,
    MapperGrid, OdometryStateTopic, RadarPoints, RadarScan, StageHealthTopic, TopicQos,
    TopicVisitor, TruthPoseTopic, TwistTopic, visit_bus_topics, visit_log_topics,
};
pub use trust_reason::TrustReason;
pub use trust_text::TrustText;
pub use truth::TruthPose;
pub use twist::Twist;

plain! {
    /// The beginning of every message.
    pub struct Header {
        /// Number of this message in its topic and epoch, from 0, without gaps.
        pub sequence: u64,
        /// The instant that the message describes; for a radar sweep its end.
        pub stamp_ns: i64,
        /// New at each start of the publisher; 0 in files.
        pub epoch: u64,
        /// When it was published, for diagnosis only; outside every comparison; 0 in files.
        pub published_ns: i64,
    }
}
