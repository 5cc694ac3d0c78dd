//! What viewers understand, made of our messages: Foxglove's well-known schemas in protobuf, one file a schema.
//!
//! Responsible for what is shown and how often. Pure: the same messages give the same bytes.

mod cloud;
mod grid;
mod pose;
mod transform;

use crate::Raw;
use foxglove::Encode;
use foxglove::messages::{Pose, Quaternion, Timestamp, Vector3};
use grid::Tiles;
use randt_config::Robot;
use randt_geometry::elementary::sin_cos;
use randt_log::Channel;
use randt_messages::{
    Correction, MapperCorrection, MapperGrid, Message, OdometryState, OdometryStateTopic,
    RadarPoints, Topic,
};

/// Frames of REP-105, as viewers see them.
const MAP: &str = "map";
const ODOM: &str = "odom";
const BASE_LINK: &str = "base_link";
const RADAR: &str = "radar";
const IMU: &str = "imu";

/// Topics for viewers.
const POSE: &str = "view/pose";
const TRANSFORMS: &str = "view/transforms";
const POINTS: &str = "view/points";
const GRID: &str = "view/grid";

/// A cloud is shown once a second, give or take a sweep: each takes as much as its scan does.
const CLOUD_PERIOD_NS: i64 = 950_000_000;

/// The channel of a topic for viewers; `None` for any other.
pub fn channel(topic: &str) -> Option<Channel> {
    use foxglove::messages::{FrameTransforms, Grid, PointCloud, PoseInFrame};
    match topic {
        POSE => Some(channel_of::<PoseInFrame>(POSE)),
        TRANSFORMS => Some(channel_of::<FrameTransforms>(TRANSFORMS)),
        POINTS => Some(channel_of::<PointCloud>(POINTS)),
        GRID => Some(channel_of::<Grid>(GRID)),
        _ => None,
    }
}

fn channel_of<T: Encode>(topic: &str) -> Channel {
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

/// Follows a run and says what a viewer needs to see of it.
#[derive(Debug)]
pub struct Viewer {
    robot: Robot,
    cloud_ns: Option<i64>,
    correction: Option<Correction>,
    tiles: Tiles,
}

impl Viewer {
    /// At the beginning of a run.
    pub fn new(robot: Robot) -> Self {
        Self {
            robot,
            cloud_ns: None,
            correction: None,
            tiles: Tiles::default(),
        }
    }

    /// A new file begins: it shall show everything by itself.
    pub fn begin(&mut self) {
        self.tiles.begin_anew();
    }

    /// What a message of ours becomes.
    pub fn see(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        if raw.topic == OdometryStateTopic::NAME {
            let Some(state) = Message::<OdometryStateTopic>::from_bytes(&raw.bytes) else {
                return;
            };
            self.see_state(&state.head, raw, out);
        } else if raw.topic == MapperCorrection::NAME {
            let read = Message::<MapperCorrection>::from_bytes(&raw.bytes);
            self.correction = read.map(|message| *message.head).or(self.correction);
        } else if raw.topic == RadarPoints::NAME {
            self.see_points(raw, out);
        } else if raw.topic == MapperGrid::NAME
            && let Some(tile) = Message::<MapperGrid>::from_bytes(&raw.bytes)
        {
            self.tiles.take(tile);
        }
    }

    fn see_points(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        let now_ns = raw.label.time_ns;
        let is_early = |last_ns: i64| (0..CLOUD_PERIOD_NS).contains(&(now_ns - last_ns));
        if self.cloud_ns.is_some_and(is_early) {
            return;
        }
        if let Some(points) = Message::<RadarPoints>::from_bytes(&raw.bytes) {
            self.cloud_ns = Some(now_ns);
            out.extend(message(POINTS, raw, &cloud::of_points(points.as_ref())));
        }
    }

    fn see_state(&mut self, state: &OdometryState, raw: &Raw, out: &mut Vec<Raw>) {
        let stamp_ns = state.header.stamp_ns;
        out.extend(message(POSE, raw, &pose::of_state(state)));
        // All of them with every state: whatever part of a log is looked at, the frames are known.
        let mut transforms = transform::mounting(&self.robot, stamp_ns);
        transforms.push(transform::of_state(state));
        let correction = self.correction.iter();
        transforms.extend(correction.map(|c| transform::of_correction(c, stamp_ns)));
        out.extend(message(TRANSFORMS, raw, &transform::all(transforms)));
        let grid = self.tiles.due(raw.label.time_ns, stamp_ns);
        out.extend(grid.and_then(|grid| message(GRID, raw, &grid)));
    }
}

/// A message for viewers, recorded with the one that it was made of; one that cannot be encoded does not exist.
fn message<T: Encode>(topic: &'static str, of: &Raw, content: &T) -> Option<Raw> {
    let mut bytes = Vec::with_capacity(content.encoded_len().unwrap_or_default());
    content.encode(&mut bytes).ok()?;
    Some(Raw {
        topic,
        label: of.label,
        bytes,
    })
}

/// A stamp as viewers have it; their time begins in 1970.
fn timestamp(stamp_ns: i64) -> Option<Timestamp> {
    let seconds = u32::try_from(stamp_ns.div_euclid(1_000_000_000)).ok()?;
    Timestamp::new_checked(seconds, stamp_ns.rem_euclid(1_000_000_000) as u32)
}

fn vector(x: f64, y: f64) -> Vector3 {
    Vector3 { x, y, z: 0.0 }
}

fn rotation(yaw_rad: f64) -> Quaternion {
    let (z, w) = sin_cos(0.5 * yaw_rad);
    Quaternion {
        x: 0.0,
        y: 0.0,
        z,
        w,
    }
}

fn pose_of([x_m, y_m, yaw_rad]: [f64; 3]) -> Pose {
    Pose {
        position: Some(vector(x_m, y_m)),
        orientation: Some(rotation(yaw_rad)),
    }
}
