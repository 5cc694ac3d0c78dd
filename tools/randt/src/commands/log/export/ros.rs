//! Our messages as ROS's, in the order in which they come: which topic each goes to, and how
//! often.

use randt_foxglove_schemas::{Graph, Pace, Tiles};
use randt_log::{Entry, Robot};
use randt_messages::{
    Correction, ImuSampleTopic, MapperCorrection, MapperGraph, MapperGrid, MessageRef,
    OdometryState, OdometryStateTopic, RadarScan, StageHealthTopic,
};
use randt_ros_messages::{
    CLOUD, DIAGNOSTICS, Definition, IMU_SAMPLE, OCCUPANCY_GRID, ODOMETRY, PATH, Style, TRANSFORMS,
    Transform, cloud, diagnostics, directions, imu_sample, occupancy_grid, odometry, path,
    transforms,
};

/// One message of ROS.
#[derive(Debug)]
pub struct Message {
    pub topic: &'static str,
    pub stamp_ns: i64,
    pub bytes: Vec<u8>,
}

/// A topic of the bags.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    pub name: &'static str,
    pub kind: Definition,
    /// Whether who subscribes late gets the last message: what is said once, or seldom.
    pub is_latched: bool,
}

const RETURNS: &str = "/radar/returns";
const IMU: &str = "/imu/data";
const STATES: &str = "/odometry";
const FRAMES: &str = "/tf";
const MOUNTING: &str = "/tf_static";
const MAP: &str = "/map";
const KEYFRAMES: &str = "/path";
const HEALTH: &str = "/diagnostics";

/// All of them.
pub const TOPICS: [Topic; 8] = [
    topic(RETURNS, CLOUD, false),
    topic(IMU, IMU_SAMPLE, false),
    topic(STATES, ODOMETRY, false),
    topic(FRAMES, TRANSFORMS, false),
    topic(MOUNTING, TRANSFORMS, true),
    topic(MAP, OCCUPANCY_GRID, true),
    topic(KEYFRAMES, PATH, true),
    topic(HEALTH, DIAGNOSTICS, false),
];

const fn topic(name: &'static str, kind: Definition, is_latched: bool) -> Topic {
    Topic {
        name,
        kind,
        is_latched,
    }
}

/// Map and path are written as often as this, or as seldom as they take no more than this.
const PERIOD_NS: i64 = 2_000_000_000;
const BYTES_PER_SECOND: i64 = 500_000;
/// A pose of a path, about.
const POSE_BYTES: usize = 76;
/// A picture of the grid has four bytes a cell, a message of ROS one.
const PICTURE_BYTES: i64 = 4;

/// Turns our messages into ROS's.
#[derive(Debug)]
pub struct Translator {
    style: Style,
    /// Until its mounting is given out.
    robot: Option<Robot>,
    correction: Option<Correction>,
    last_state: Option<u64>,
    stamp_ns: i64,
    graph: Graph,
    graph_pace: Pace,
    tiles: Tiles,
    grid_pace: Pace,
}

impl Translator {
    pub fn new(style: Style, robot: Robot) -> Self {
        let pace = Pace::new(PERIOD_NS, BYTES_PER_SECOND);
        Self {
            style,
            robot: Some(robot),
            correction: None,
            last_state: None,
            stamp_ns: 0,
            graph: Graph::default(),
            graph_pace: pace,
            tiles: Tiles::default(),
            grid_pace: pace,
        }
    }

    /// What a message becomes; the mounting stands before all else.
    pub fn translate(&mut self, entry: &Entry<'_>) -> Result<Vec<Message>, randt_log::Error> {
        let mut messages = self.translate_one(entry)?;
        if let Some(stamp_ns) = messages.first().map(|first| first.stamp_ns)
            && let Some(robot) = self.robot.take()
        {
            messages.insert(0, self.mounting(&robot, stamp_ns));
        }
        Ok(messages)
    }

    /// The log is over: what was held back for its size is written as it is at last.
    pub fn finish(&self) -> Vec<Message> {
        let mut messages = Vec::new();
        if self.graph_pace.is_behind() {
            messages.extend(self.path());
        }
        if self.grid_pace.is_behind() {
            messages.extend(self.map());
        }
        messages
    }

    fn translate_one(&mut self, entry: &Entry<'_>) -> Result<Vec<Message>, randt_log::Error> {
        if let Some(scan) = entry.decode::<RadarScan>()? {
            return Ok(vec![self.cloud(scan.as_ref())]);
        }
        if let Some(sample) = entry.decode::<ImuSampleTopic>()? {
            let bytes = imu_sample(self.style, &sample.head);
            return Ok(vec![message(IMU, sample.head.header.stamp_ns, bytes)]);
        }
        if let Some(health) = entry.decode::<StageHealthTopic>()? {
            let bytes = diagnostics(self.style, &health.head);
            return Ok(vec![message(HEALTH, health.head.header.stamp_ns, bytes)]);
        }
        if let Some(correction) = entry.decode::<MapperCorrection>()? {
            self.correction = Some(*correction.head);
        } else if let Some(page) = entry.decode::<MapperGraph>()? {
            let before = self.graph.version();
            if self.graph.take(page.as_ref()) && before != self.graph.version() {
                self.graph_pace.change();
            }
        } else if let Some(tile) = entry.decode::<MapperGrid>()? {
            self.tiles.take(tile);
            self.grid_pace.change();
        }
        match entry.decode::<OdometryStateTopic>()? {
            // A stage that came back sends its last states again.
            Some(state) if self.last_state.is_none_or(|last| state.head.id > last) => {
                self.last_state = Some(state.head.id);
                self.stamp_ns = state.head.header.stamp_ns;
                let mut messages = self.state(&state.head);
                messages.extend(self.drawings(entry.time_ns));
                Ok(messages)
            }
            _ => Ok(Vec::new()),
        }
    }

    /// Where the sensors sit; unknown mountings are none.
    fn mounting(&self, robot: &Robot, stamp_ns: i64) -> Message {
        let imu = robot.imu.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let frames = Transform::mounting(robot.radar.unwrap_or_default(), imu);
        message(
            MOUNTING,
            stamp_ns,
            transforms(self.style, stamp_ns, &frames),
        )
    }

    fn cloud(&self, scan: MessageRef<'_, RadarScan>) -> Message {
        let header = scan.head.header;
        let directions = directions(&scan.head.sweep);
        let points = scan.items.iter().filter_map(|point| {
            let (sine, cosine) = directions.get(usize::from(point.beam))?;
            let range_m = f64::from(point.range_m);
            let [x_m, y_m] = [cosine, sine].map(|direction| (range_m * direction) as f32);
            Some([x_m, y_m, point.intensity])
        });
        let bytes = cloud(self.style, header.sequence, header.stamp_ns, points);
        message(RETURNS, header.stamp_ns, bytes)
    }

    fn state(&self, state: &OdometryState) -> Vec<Message> {
        let stamp_ns = state.header.stamp_ns;
        let mut frames = vec![Transform::odometry(state)];
        let of_frame = |c: &&Correction| c.odom_frame_id == state.odom_frame_id;
        let correction = self.correction.as_ref().filter(of_frame);
        frames.extend(correction.map(Transform::correction));
        vec![
            message(STATES, stamp_ns, odometry(self.style, state)),
            message(FRAMES, stamp_ns, transforms(self.style, stamp_ns, &frames)),
        ]
    }

    /// Path and map, where they are due.
    fn drawings(&mut self, now_ns: i64) -> Vec<Message> {
        let mut messages = Vec::new();
        let path_bytes = self.graph.nodes().count() * POSE_BYTES;
        if path_bytes > 0 && self.graph_pace.is_due(now_ns, path_bytes) {
            messages.extend(self.path());
        }
        let grid_bytes = self.tiles.size().map(|size| size / PICTURE_BYTES);
        if let Some(bytes) = grid_bytes.and_then(|bytes| usize::try_from(bytes).ok())
            && self.grid_pace.is_due(now_ns, bytes)
        {
            messages.extend(self.map());
        }
        messages
    }

    /// The keyframes of the component of the map that the newest one belongs to.
    fn path(&self) -> Option<Message> {
        let component = self.graph.nodes().next_back()?.b;
        let nodes = self.graph.nodes().filter(|node| node.b == component);
        let poses: Vec<_> = nodes.map(|node| (node.stamp_ns, node.pose)).collect();
        let bytes = path(self.style, self.stamp_ns, &poses);
        Some(message(KEYFRAMES, self.stamp_ns, bytes))
    }

    fn map(&self) -> Option<Message> {
        let cells = self.tiles.cells()?;
        let bytes = occupancy_grid(self.style, self.stamp_ns, &cells);
        Some(message(MAP, self.stamp_ns, bytes))
    }
}

fn message(topic: &'static str, stamp_ns: i64, bytes: Vec<u8>) -> Message {
    Message {
        topic,
        stamp_ns,
        bytes,
    }
}
