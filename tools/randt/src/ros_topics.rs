//! Our messages as ROS's, in the order in which they come: which topic each goes to, and how
//! often.

use randt_foxglove_schemas::{Graph, Pace, Tiles};
use randt_log::{Entry, Robot};
use randt_messages::{
    Correction, Header, ImuSampleTopic, MapperCorrection, MapperGraph, MapperGrid, MessageRef,
    OdometryState, OdometryStateTopic, RadarPoints, RadarScan, Return, StageHealth,
    StageHealthTopic, SweepHead,
};
use randt_ros_messages::{
    CLOUD, DIAGNOSTICS, Definition, IMU_SAMPLE, OCCUPANCY_GRID, ODOMETRY, PATH, POSE_ARRAY, Style,
    TRANSFORMS, Transform, cloud, diagnostics, directions, imu_sample, occupancy_grid, odometry,
    path, pose_array, transforms,
};

/// One message of ROS.
#[derive(Debug)]
pub struct Message {
    /// One of [`TOPICS`] or [`LIVE_TOPICS`].
    pub topic: &'static str,
    /// The sensor's.
    pub stamp_ns: i64,
    /// As ROS serialises it.
    pub bytes: Vec<u8>,
}

/// A topic of the bags.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub kind: Definition,
    /// Whether who subscribes late gets the last message: what is said once, or seldom.
    pub is_latched: bool,
}

const RETURNS: &str = "/radar/returns";
/// Live the returns that the filter has left: a robot has those of its radar already.
const POINTS: &str = "/radar/points";
const IMU: &str = "/imu/data";
const STATES: &str = "/odometry";
const FRAMES: &str = "/tf";
const MOUNTING: &str = "/tf_static";
const MAP: &str = "/map";
const KEYFRAMES: &str = "/path";
const HEALTH: &str = "/diagnostics";
/// The path's poses, which in a bag would say the same twice.
const POSES: &str = "/keyframes";

/// Those of a log.
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

/// Those of a running pipeline: what others would call the same is below `/randt`.
pub const LIVE_TOPICS: [(Topic, &str); 8] = [
    (topic(POINTS, CLOUD, false), "/randt/radar/points"),
    (topic(STATES, ODOMETRY, false), "/randt/odometry"),
    (topic(FRAMES, TRANSFORMS, false), "/tf"),
    (topic(MOUNTING, TRANSFORMS, true), "/tf_static"),
    (topic(MAP, OCCUPANCY_GRID, true), "/randt/map"),
    (topic(KEYFRAMES, PATH, true), "/randt/path"),
    (topic(POSES, POSE_ARRAY, true), "/randt/keyframes"),
    (topic(HEALTH, DIAGNOSTICS, false), "/diagnostics"),
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
    /// Nothing has come yet. `robot`: where the sensors sit.
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
        let messages = self.translate_one(entry)?;
        Ok(self.with_mounting(messages))
    }

    /// The mounting, if it has not been given out, and then these.
    pub fn with_mounting(&mut self, mut messages: Vec<Message>) -> Vec<Message> {
        if let Some(stamp_ns) = messages.first().map(|first| first.stamp_ns)
            && let Some(robot) = self.robot.take()
        {
            messages.insert(0, self.mounting(&robot, stamp_ns));
        }
        messages
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
            let scan = scan.as_ref();
            return Ok(vec![self.cloud(
                RETURNS,
                scan.head.header,
                &scan.head.sweep,
                scan.items,
            )]);
        }
        if let Some(sample) = entry.decode::<ImuSampleTopic>()? {
            let bytes = imu_sample(self.style, &sample.head);
            return Ok(vec![message(IMU, sample.head.header.stamp_ns, bytes)]);
        }
        if let Some(health) = entry.decode::<StageHealthTopic>()? {
            return Ok(vec![self.health(&health.head)]);
        }
        if let Some(correction) = entry.decode::<MapperCorrection>()? {
            self.take_correction(&correction.head);
        } else if let Some(page) = entry.decode::<MapperGraph>()? {
            self.take_graph(page.as_ref());
        } else if let Some(tile) = entry.decode::<MapperGrid>()? {
            self.take_tile(tile);
        }
        let state = entry.decode::<OdometryStateTopic>()?;
        Ok(state.map_or_else(Vec::new, |state| {
            self.take_state(&state.head, entry.time_ns)
        }))
    }

    /// Takes where the mapper places odometry's frame.
    pub fn take_correction(&mut self, correction: &Correction) {
        let known = self.correction.replace(*correction);
        if known.is_some_and(|known| known.graph_version > correction.graph_version) {
            // Another drive: the map is void.
            (self.graph, self.tiles) = (Graph::default(), Tiles::default());
        }
    }

    /// Takes a page of the graph.
    pub fn take_graph(&mut self, page: MessageRef<'_, MapperGraph>) {
        let before = self.graph.version();
        if self.graph.take(page) && before != self.graph.version() {
            self.graph_pace.change();
        }
    }

    /// Takes a tile of the grid.
    pub fn take_tile(&mut self, tile: randt_messages::Message<MapperGrid>) {
        self.tiles.take(tile);
        self.grid_pace.change();
    }

    /// A state, once, with path and map where they are due at the instant at which it came.
    pub fn take_state(&mut self, state: &OdometryState, now_ns: i64) -> Vec<Message> {
        // A stage that came back sends its last states again; one without its memory, or of another
        // drive, counts anew.
        let is_known = self.last_state.is_some_and(|last| state.id <= last);
        if is_known && state.header.stamp_ns <= self.stamp_ns {
            return Vec::new();
        }
        self.last_state = Some(state.id);
        self.stamp_ns = state.header.stamp_ns;
        let mut messages = self.state(state);
        messages.extend(self.drawings(now_ns));
        messages
    }

    /// How a stage is.
    pub fn health(&self, health: &StageHealth) -> Message {
        let bytes = diagnostics(self.style, health);
        message(HEALTH, health.header.stamp_ns, bytes)
    }

    /// What the filter has left of a sweep.
    pub fn points(&self, points: MessageRef<'_, RadarPoints>) -> Message {
        let head = points.head;
        self.cloud(POINTS, head.header, &head.sweep, points.items)
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

    fn cloud(
        &self,
        topic: &'static str,
        header: Header,
        sweep: &SweepHead,
        returns: &[Return],
    ) -> Message {
        let directions = directions(sweep);
        let points = returns.iter().filter_map(|point| {
            let (sine, cosine) = directions.get(usize::from(point.beam))?;
            let range_m = f64::from(point.range_m);
            let [x_m, y_m] = [cosine, sine].map(|direction| (range_m * direction) as f32);
            Some([x_m, y_m, point.intensity])
        });
        let bytes = cloud(self.style, header.sequence, header.stamp_ns, points);
        message(topic, header.stamp_ns, bytes)
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
    fn path(&self) -> Vec<Message> {
        let newest = self.graph.nodes().next_back();
        let Some(component) = newest.map(|node| node.b) else {
            return Vec::new();
        };
        let nodes = self.graph.nodes().filter(|node| node.b == component);
        let poses: Vec<_> = nodes.map(|node| (node.stamp_ns, node.pose)).collect();
        let path = path(self.style, self.stamp_ns, &poses);
        let poses = poses.iter().map(|(_, pose)| *pose);
        let poses = pose_array(self.style, self.stamp_ns, poses);
        vec![
            message(KEYFRAMES, self.stamp_ns, path),
            message(POSES, self.stamp_ns, poses),
        ]
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

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::TILE_CELLS;

    fn translator() -> Translator {
        Translator::new(
            Style::Ros1,
            Robot {
                sensor: randt_messages::SensorKind::Unknown,
                radar: None,
                imu: None,
            },
        )
    }

    fn state(id: u64, stamp_s: i64) -> OdometryState {
        let mut state = OdometryState {
            id,
            ..OdometryState::default()
        };
        state.header.stamp_ns = stamp_s * 1_000_000_000;
        state
    }

    #[test]
    fn a_state_goes_once_and_those_of_another_drive_go_too() {
        let mut translator = translator();
        let mut sent = |id, stamp_s| !translator.take_state(&state(id, stamp_s), 0).is_empty();
        assert!(sent(7, 10) && sent(8, 11));
        // Again, by a stage that came back.
        assert!(!sent(7, 10) && !sent(8, 11));
        assert!(sent(9, 12));
        assert!(sent(0, 13) && sent(1, 14) && !sent(1, 14));
    }

    #[test]
    fn the_map_of_another_drive_does_not_stay() {
        let mut translator = translator();
        let mut tile = randt_messages::Message::<MapperGrid>::default();
        tile.head.resolution_m = 0.1;
        tile.items = vec![Default::default(); TILE_CELLS * TILE_CELLS];
        let correction = |graph_version| Correction {
            graph_version,
            ..Correction::default()
        };
        translator.take_correction(&correction(5));
        translator.take_tile(tile);
        translator.take_correction(&correction(6));
        assert!(translator.tiles.cells().is_some());
        translator.take_correction(&correction(1));
        assert!(translator.tiles.cells().is_none());
    }
}
