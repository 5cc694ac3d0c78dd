//! What is known of a pipeline at an instant, under the names that other programs read.

use crate::latency::LatencyFigures;
use randt_geometry::Pose2;
use randt_messages::{Correction, GraphHead, OdometryState, TrustReason, TrustText};
use serde::Serialize;

/// Everything that is shown.
#[derive(Debug, Serialize)]
pub struct Snapshot {
    /// Name of the pipeline.
    pub prefix: String,
    /// Its run folder.
    pub run: String,
    /// Every stage in the register.
    pub stages: Vec<StageRow>,
    /// Every topic that a stage has open.
    pub topics: Vec<TopicRow>,
    /// Of the last states.
    pub latency_ms: LatencyFigures,
    /// Where the robot is; null before odometry's first state.
    pub robot: Option<Robot>,
    /// The map; null before the mapper's first graph.
    pub map: Option<Map>,
    /// What a person should read.
    pub notes: Vec<String>,
}

/// A stage.
#[derive(Debug, Serialize)]
pub struct StageRow {
    /// Name such as `odometry`.
    pub name: String,
    /// Process; of one that is no more the last one.
    pub pid: u64,
    /// starting, running, degraded, stopping, finished, stopped, dead.
    pub state: &'static str,
    /// Epoch of its messages.
    pub epoch: u64,
    /// Starts before this one.
    pub restarts: u64,
    /// Share of one processor, %.
    pub cpu_percent: Option<f64>,
    /// Memory, bytes.
    pub rss_bytes: Option<u64>,
    /// Data lost in the stage itself.
    pub lost: u64,
    /// What is wrong; empty where nothing is.
    pub message: String,
}

/// A topic.
#[derive(Debug, Serialize)]
pub struct TopicRow {
    /// Name with version.
    pub name: String,
    /// Messages per second, of all writers.
    pub rate_hz: f64,
    /// Since the last message; null where there was none.
    pub age_s: Option<f64>,
    /// Messages that its readers missed.
    pub lost: u64,
}

/// The last state of odometry.
#[derive(Debug, Serialize)]
pub struct Robot {
    /// In `odom`.
    pub pose: Pose,
    /// In `map`, where the mapper has placed this odometry frame.
    pub map_pose: Option<Pose>,
    /// Forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// good, degraded, lost.
    pub trust: &'static str,
    /// Why it is not good: names of [`TrustReason`].
    pub trust_reasons: Vec<&'static str>,
    /// Trust and its reasons for a person.
    pub trust_text: String,
    /// Which directions of the position the scan saw: full, partial, none; unknown.
    pub localizability: &'static str,
    /// The direction that is not seen, in the robot's frame; null unless it is one.
    pub weak_direction_rad: Option<f64>,
    /// Since all of this was published.
    pub age_s: f64,
    /// About the IMU's x, y, z.
    pub gyro_bias_rad_s: [f64; 3],
    /// The odometry frame.
    pub odom_frame_id: u64,
    /// The scan's number since odometry began.
    pub scan: u64,
}

/// A pose.
#[derive(Debug, Serialize)]
pub struct Pose {
    /// x, m.
    pub x_m: f64,
    /// y, m.
    pub y_m: f64,
    /// Counter-clockwise from x.
    pub yaw_rad: f64,
}

/// The state of the map.
#[derive(Debug, Serialize)]
pub struct Map {
    /// Keyframes in the graph.
    pub keyframes: u64,
    /// Keyframes on disk.
    pub on_disk: u64,
    /// Loops in force.
    pub loops: u64,
    /// Loops that confirm the graph and cost no edge.
    pub confirmed_loops: u64,
    /// Connected components.
    pub components: u64,
    /// Path over all keyframes, m.
    pub path_m: f64,
    /// Tiles of the occupancy grid.
    pub tiles: u64,
    /// Version of the graph.
    pub version: u64,
}

impl Robot {
    /// Of a state, placed in the map by the last correction.
    pub fn from_state(state: &OdometryState, correction: Option<&Correction>, now_ns: i64) -> Self {
        let pose = Pose2::from_array(state.pose);
        let placed = correction.filter(|to| to.odom_frame_id == state.odom_frame_id);
        let map_pose = placed.map(|to| Pose2::from_array(to.map_from_odom).compose(&pose));
        Self {
            pose: Pose::from_pose2(&pose),
            map_pose: map_pose.map(|pose| Pose::from_pose2(&pose)),
            velocity: state.velocity,
            trust: state.trust().as_str(),
            trust_reasons: TrustReason::in_set(state.trust_reasons)
                .map(TrustReason::as_str)
                .collect(),
            trust_text: TrustText::new(state).to_string(),
            localizability: state.localizability().as_str(),
            weak_direction_rad: state.weak_direction(),
            age_s: (now_ns - state.header.published_ns) as f64 * 1e-9,
            gyro_bias_rad_s: state.gyro_bias_rad_s,
            odom_frame_id: state.odom_frame_id,
            scan: state.id,
        }
    }
}

impl Pose {
    fn from_pose2(pose: &Pose2) -> Self {
        let [x_m, y_m, yaw_rad] = pose.to_array();
        Self { x_m, y_m, yaw_rad }
    }
}

impl From<&GraphHead> for Map {
    fn from(head: &GraphHead) -> Self {
        Self {
            keyframes: head.keyframes,
            on_disk: head.on_disk,
            loops: head.loops,
            confirmed_loops: head.confirmed_loops,
            components: head.components,
            path_m: head.path_m,
            tiles: head.tiles,
            version: head.graph_version,
        }
    }
}

/// One whose values are as long as they become.
#[cfg(test)]
pub fn sample() -> Snapshot {
    let far = || Pose {
        x_m: -1234.567,
        y_m: -1234.567,
        yaw_rad: -3.0,
    };
    let topic = |topic: &randt_messages::BusTopic| TopicRow {
        name: topic.name.to_owned(),
        rate_hz: 250.0,
        age_s: Some(99.0),
        lost: 12_345,
    };
    let stage = |name: &str| StageRow {
        name: name.to_owned(),
        pid: 4_194_304,
        state: "degraded",
        epoch: 1,
        restarts: 123,
        cpu_percent: Some(100.0),
        rss_bytes: Some(123_456_789),
        lost: 12_345,
        message: String::new(),
    };
    Snapshot {
        prefix: "randt".to_owned(),
        run: "/run/randt".to_owned(),
        stages: ["radar", "odometry", "recorder"].map(stage).into(),
        topics: randt_messages::BUS_TOPICS.iter().map(topic).collect(),
        latency_ms: LatencyFigures {
            wait_p50: Some(123.45),
            wait_p99: Some(123.45),
            compute_p50: Some(1.25),
            compute_p99: Some(123.45),
        },
        robot: Some(Robot {
            pose: far(),
            map_pose: Some(far()),
            velocity: [-12.345, -0.123, -2.0],
            trust: "degraded",
            trust_reasons: vec!["weak", "held"],
            trust_text: String::new(),
            localizability: "partial",
            weak_direction_rad: Some(-1.5),
            age_s: 99.0,
            gyro_bias_rad_s: [-0.01, -0.02, 0.03],
            odom_frame_id: 0,
            scan: 0,
        }),
        map: Some(Map {
            keyframes: 12_345,
            on_disk: 12_345,
            loops: 12_345,
            confirmed_loops: 12_345,
            components: 12,
            path_m: 12_345.678,
            tiles: 1234,
            version: 0,
        }),
        notes: Vec::new(),
    }
}
