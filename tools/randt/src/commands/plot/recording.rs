//! What the pictures show of a log, gathered in one pass.

use crate::output::warn;
use crate::{job, progress, recorded};
use anyhow::ensure;
use nalgebra::Vector3;
use randt_evaluation::Trajectory;
use randt_foxglove_schemas::Graph;
use randt_geometry::{Pose2, Quaternion};
use randt_log::{Entry, LogReader};
use randt_messages::{
    Correction, ImuSampleTopic, Keyframe, LogDrop, LogDropTopic, MapperCorrection, MapperGraph,
    OdometryState, OdometryStateTopic, RadarPoints, RadarScan, Topic, TruthPoseTopic,
};
use randt_readers::log_files;
use std::collections::BTreeMap;
use std::path::Path;

/// Of each keyframe every fourth point is kept: the picture of a run shows no more.
const STRIDE: usize = 4;

/// A keyframe.
pub struct Sketch {
    pub odom_frame_id: u64,
    pub stamp_ns: i64,
    /// In `odom`.
    pub pose: Pose2,
    /// Every fourth point, in the keyframe's `base_link`, m.
    pub points: Vec<[f32; 2]>,
}

/// Everything, by the log's time: when it was published. Its fields are the series that the
/// pictures draw, gathered in one pass.
#[derive(Default)]
pub struct Recording {
    /// Every state once, with the log's time, ns.
    pub states: Vec<(i64, OdometryState)>,
    /// Poses in `map` as it was known then; the frame is the part of the map.
    pub live: Trajectory,
    pub truth: Trajectory,
    /// The log's time, ns, and the gyro's rate about `base_link`'s z, rad/s.
    pub gyro: Vec<(i64, f64)>,
    /// The log's time, ns, and the number of returns: all, and those that the filter left.
    pub scans: Vec<(i64, usize)>,
    pub points: Vec<(i64, usize)>,
    /// By their numbers.
    pub keyframes: BTreeMap<u64, Sketch>,
    pub graph: Graph,
    /// When each topic's messages were published, ns.
    pub topics: BTreeMap<String, Vec<i64>>,
    pub drops: Vec<LogDrop>,
    /// What was stepped over.
    pub damage: Vec<String>,
    begin_ns: i64,
    end_ns: i64,
    correction: Option<Correction>,
}

impl Recording {
    /// Reads a log, or a folder of logs, through.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let mut recording = Self {
            live: Trajectory::stamped(),
            truth: Trajectory::stamped(),
            ..Self::default()
        };
        let logs = log_files(path)?;
        recording.damage.extend(logs.unreadable);
        for file in logs.files {
            recording.take_file(&file)?;
        }
        let times = || recording.topics.values().flatten().copied();
        let ends = times().min().zip(times().max());
        ensure!(
            ends.is_some(),
            "{}: holds no message of ours, so there is nothing to draw",
            path.display()
        );
        (recording.begin_ns, recording.end_ns) = ends.unwrap_or_default();
        Ok(recording)
    }

    fn take_file(&mut self, path: &Path) -> anyhow::Result<()> {
        let mut reader = LogReader::open(path)?;
        let robot = recorded::configuration(reader.robot()?, reader.configuration())?.robot;
        let (roll, pitch, yaw) = (robot.imu_roll_rad, robot.imu_pitch_rad, robot.imu_yaw_rad);
        let imu = Quaternion::from_roll_pitch_yaw(roll, pitch, yaw);
        let bar = progress::bar(Some(reader.progress().1), "bytes");
        while let Some(entry) = reader.next_entry()? {
            ensure!(!job::interrupted(), "interrupted; nothing was drawn");
            if entry.channel.is_ours() {
                self.take(&entry, &imu)?;
            }
            bar.set_position(reader.progress().0);
        }
        bar.finish_and_clear();
        reader.translated().for_each(|text| warn(&text));
        let damage = reader.damage().iter();
        self.damage
            .extend(damage.map(|damage| damage.first.clone()));
        Ok(())
    }

    fn take(&mut self, entry: &Entry<'_>, imu: &Quaternion) -> anyhow::Result<()> {
        let time_ns = entry.time_ns;
        if let Some(drop) = entry.decode::<LogDropTopic>()? {
            // Its times are those of other messages: its own is when the disk was back.
            self.drops.push(*drop.head);
            return Ok(());
        }
        let topic = entry.channel.topic.clone();
        self.topics.entry(topic).or_default().push(time_ns);
        if let Some(sample) = entry.decode::<ImuSampleTopic>()? {
            let rate_rad_s = imu.rotate(Vector3::from(sample.head.rate_rad_s));
            self.gyro.push((time_ns, rate_rad_s.z));
        } else if let Some(scan) = entry.decode::<RadarScan>()? {
            self.scans.push((time_ns, scan.items.len()));
        } else if let Some(points) = entry.decode::<RadarPoints>()? {
            self.points.push((time_ns, points.items.len()));
        } else if let Some(state) = entry.decode::<OdometryStateTopic>()? {
            self.take_state(time_ns, &state.head);
        } else if let Some(keyframe) = entry.decode::<Keyframe>()? {
            let head = &keyframe.head;
            self.graph.know(head.id, head.odom_frame_id);
            let points = keyframe.items.iter().step_by(STRIDE);
            let sketch = Sketch {
                odom_frame_id: head.odom_frame_id,
                stamp_ns: head.header.stamp_ns,
                pose: Pose2::from_array(head.pose),
                points: points.map(|point| [point.x_m, point.y_m]).collect(),
            };
            self.keyframes.insert(head.id, sketch);
        } else if let Some(correction) = entry.decode::<MapperCorrection>()? {
            self.correction = Some(*correction.head);
        } else if let Some(page) = entry.decode::<MapperGraph>()? {
            self.graph.take(page.as_ref());
        } else if let Some(pose) = entry.decode::<TruthPoseTopic>()? {
            let (stamp_ns, pose) = (pose.head.header.stamp_ns, pose.head.pose);
            self.truth.push(stamp_ns, 0, Pose2::from_array(pose));
        }
        Ok(())
    }

    fn take_state(&mut self, time_ns: i64, state: &OdometryState) {
        // A stage that came back sends its last states again.
        let newest = self.states.last();
        if newest.is_some_and(|(_, newest)| state.id <= newest.id) {
            return;
        }
        self.states.push((time_ns, *state));
        let of_frame = |c: &Correction| c.odom_frame_id == state.odom_frame_id;
        if let Some(correction) = self.correction.filter(of_frame) {
            let odom = Pose2::from_array(correction.map_from_odom);
            let map = odom.compose(&Pose2::from_array(state.pose));
            let stamp_ns = state.header.stamp_ns;
            self.live.push(stamp_ns, correction.component, map);
        }
    }

    /// Seconds since the log's beginning.
    pub fn after_s(&self, time_ns: i64) -> f64 {
        time_ns.saturating_sub(self.begin_ns) as f64 * 1e-9
    }

    /// How long the log is, s.
    pub fn span_s(&self) -> f64 {
        self.after_s(self.end_ns)
    }

    /// Whether a topic has messages.
    pub fn has<T: Topic>(&self) -> bool {
        self.topics.contains_key(T::NAME)
    }
}
