//! What viewers understand, made of our messages: live Foxglove's well-known schemas in protobuf,
//! one file a schema; in a recording ROS's messages.
//!
//! Responsible for what a message looks like, what its topic is called and how often it goes at
//! most, not for when it goes. Pure: the same messages give the same bytes.

mod cloud;
mod ellipse;
mod graph;
mod graph_entities;
mod grid;
mod markers;
mod notice;
mod pace;
mod pose;
mod scene;
pub mod status;
mod submap_cells;
pub mod tile;
pub mod topic;
mod transform;

pub use cloud::{of_points, of_scan, of_some_points, recorded_points};
pub use ellipse::of_cells;
pub use foxglove::messages::{FrameTransforms, Grid, Log, PointCloud, PoseInFrame, SceneUpdate};
pub use graph::Graph;
pub use graph_entities::{empty_entity, graph_entities};
pub use grid::Tiles;
pub use markers::{cell_markers, graph_markers, loop_markers};
pub use notice::of_drop;
pub use pace::Pace;
pub use pose::of_state as pose_of_state;
pub use scene::clear;
pub use submap_cells::SubmapCells;
pub use topic::ViewerTopic;
pub use transform::{mounting, transforms};

pub use foxglove::Encode;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, Pose, Quaternion, Timestamp, Vector3};
use randt_geometry::elementary::sin_cos;
use randt_log::Channel;
pub use randt_ros_messages::{BASE_LINK, IMU, MAP, ODOM, RADAR};

/// The channel of a topic with messages of this schema.
pub fn channel<T: Encode>(topic: &str) -> Channel {
    let mut channel = Channel {
        topic: topic.to_owned(),
        message_encoding: T::get_message_encoding(),
        ..Channel::default()
    };
    if let Some(schema) = T::get_schema() {
        channel.type_name = schema.name;
        channel.schema_encoding = schema.encoding;
        channel.schema = schema.data.into_owned();
    }
    channel
}

/// A message's bytes; one that cannot be encoded does not exist.
pub fn bytes<T: Encode>(message: &T) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    message.encode(&mut bytes).ok()?;
    Some(bytes)
}

/// A stamp as viewers have it; their time begins in 1970.
pub fn timestamp(stamp_ns: i64) -> Option<Timestamp> {
    let seconds = u32::try_from(stamp_ns.div_euclid(1_000_000_000)).ok()?;
    Timestamp::new_checked(seconds, stamp_ns.rem_euclid(1_000_000_000) as u32)
}

/// A pose in the plane.
pub fn pose_of(pose: [f64; 3]) -> Pose {
    pose_above(pose, 0.0)
}

/// The same at a height, m.
fn pose_above([x, y, yaw_rad]: [f64; 3], z: f64) -> Pose {
    let (sine, cosine) = sin_cos(0.5 * yaw_rad);
    Pose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion {
            x: 0.0,
            y: 0.0,
            z: sine,
            w: cosine,
        }),
    }
}

/// Fields of packed elements, one behind the other, each of this many bytes.
fn packed_fields(names: &[&str], kind: NumericType, bytes: u32) -> Vec<PackedElementField> {
    let field = |(name, offset): (&&str, u32)| PackedElementField {
        name: (*name).to_owned(),
        offset: bytes * offset,
        r#type: kind as i32,
    };
    names.iter().zip(0..).map(field).collect()
}
