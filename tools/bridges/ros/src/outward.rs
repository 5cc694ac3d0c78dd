//! From the pipeline to ROS: poses and frames, path and grid, the filtered sweep, and health.

use randt::ros_topics::{LIVE_TOPICS, Message, Topic, Translator};
use randt_config::Config;
use randt_geometry::Quaternion;
use randt_log::Robot;
use randt_messages::{
    MapperCorrection, MapperGraph, MapperGrid, OdometryStateTopic, RadarPoints, SensorKind,
    StageHealthTopic,
};
use randt_ros_messages::Style;
use randt_stage::{Error, Stage, Subscriber, Waitable};

/// What the mapper has of the map, and has on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// One more than its newest keyframe.
    pub keyframes: u64,
    /// Keyframes below this number are on the disk.
    pub on_disk: u64,
}

/// The topics that are read.
pub struct Outward {
    translator: Translator,
    kept: Option<Kept>,
    corrections: Subscriber<MapperCorrection>,
    graph: Subscriber<MapperGraph>,
    grid: Subscriber<MapperGrid>,
    points: Subscriber<RadarPoints>,
    states: Subscriber<OdometryStateTopic>,
    health: Subscriber<StageHealthTopic>,
}

impl Outward {
    /// Opens the topics.
    pub fn open(stage: &mut Stage, style: Style, config: &Config) -> Result<Self, Error> {
        Ok(Self {
            translator: Translator::new(style, mounting(config)),
            kept: None,
            corrections: stage.subscriber()?,
            graph: stage.subscriber()?,
            grid: stage.subscriber()?,
            points: stage.subscriber()?,
            states: stage.subscriber()?,
            health: stage.subscriber()?,
        })
    }

    /// What to wait for. The rest is slow, and goes with what comes next: each topic that a stage
    /// waits for costs a dozen system calls a wait.
    pub fn waitables(&self) -> [&dyn Waitable; 2] {
        [&self.states, &self.points]
    }

    /// What the mapper has said last.
    pub fn kept(&self) -> Option<Kept> {
        self.kept
    }

    /// Publishes what has come, each message with its topic and the topic's name. The correction
    /// first, so that a state is placed by the newest.
    pub fn send(
        &mut self,
        now_ns: i64,
        mut publish: impl FnMut(&Topic, &'static str, Message),
    ) -> Result<(), Error> {
        while let Some(correction) = self.corrections.receive()? {
            self.translator.take_correction(correction.message().head);
        }
        while let Some(page) = self.graph.receive()? {
            let head = page.message().head;
            self.kept = Some(Kept {
                keyframes: head.wanted_keyframe,
                on_disk: head.on_disk,
            });
            self.translator.take_graph(page.message());
        }
        while let Some(tile) = self.grid.receive()? {
            let message = tile.message();
            let mut tile = randt_messages::Message::<MapperGrid>::default();
            *tile.head = *message.head;
            tile.items = message.items.to_vec();
            self.translator.take_tile(tile);
        }
        while let Some(points) = self.points.receive()? {
            let messages = vec![self.translator.points(points.message())];
            self.publish(messages, &mut publish);
        }
        while let Some(state) = self.states.receive()? {
            let messages = self.translator.take_state(state.message().head, now_ns);
            self.publish(messages, &mut publish);
        }
        while let Some(health) = self.health.receive()? {
            let messages = vec![self.translator.health(health.message().head)];
            self.publish(messages, &mut publish);
        }
        Ok(())
    }

    fn publish(
        &mut self,
        messages: Vec<Message>,
        publish: &mut impl FnMut(&Topic, &'static str, Message),
    ) {
        for message in self.translator.with_mounting(messages) {
            let mut topics = LIVE_TOPICS.iter();
            if let Some((topic, name)) = topics.find(|(topic, _)| topic.name == message.topic) {
                publish(topic, name, message);
            }
        }
    }
}

/// Where the sensors sit, as ROS gets it.
fn mounting(config: &Config) -> Robot {
    let it = &config.robot;
    let imu = Quaternion::from_roll_pitch_yaw(it.imu_roll_rad, it.imu_pitch_rad, it.imu_yaw_rad);
    Robot {
        sensor: SensorKind::Unknown,
        radar: Some([it.radar_x_m, it.radar_y_m, it.radar_yaw_rad]),
        imu: Some(imu.to_array()),
    }
}
