//! From the pipeline to ROS: poses and frames, path and grid, the filtered sweep, and health.

use crate::frame::Frame;
use crate::node::Node;
use randt::ros_topics::{LIVE_TOPICS, Message, Topic, Translator};
use randt_log::Robot;
use randt_messages::{
    MapperCorrection, MapperGraph, MapperGrid, OdometryStateTopic, RadarPoints, StageHealthTopic,
};
use randt_ros_messages::Style;
use randt_stage::{Error, Stage, Subscriber, Waitable};

/// The topics that are read.
pub struct Outward {
    translator: Translator,
    corrections: Subscriber<MapperCorrection>,
    graph: Subscriber<MapperGraph>,
    grid: Subscriber<MapperGrid>,
    points: Subscriber<RadarPoints>,
    states: Subscriber<OdometryStateTopic>,
    health: Subscriber<StageHealthTopic>,
}

impl Outward {
    /// Opens the topics. `robot`: where the sensors sit.
    pub fn open(stage: &mut Stage, robot: Robot) -> Result<Self, Error> {
        Ok(Self {
            translator: Translator::new(Style::Ros1, robot),
            corrections: stage.subscriber()?,
            graph: stage.subscriber()?,
            grid: stage.subscriber()?,
            points: stage.subscriber()?,
            states: stage.subscriber()?,
            health: stage.subscriber()?,
        })
    }

    /// What to wait for.
    pub fn waitables(&self) -> [&dyn Waitable; 6] {
        [
            &self.corrections,
            &self.graph,
            &self.grid,
            &self.points,
            &self.states,
            &self.health,
        ]
    }

    /// Publishes what has come. The correction first, so that a state is placed by the newest.
    pub fn send(&mut self, node: &mut Node, now_ns: i64) -> Result<(), Error> {
        while let Some(correction) = self.corrections.receive()? {
            self.translator.take_correction(correction.message().head);
        }
        while let Some(page) = self.graph.receive()? {
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
            self.publish(node, messages);
        }
        while let Some(state) = self.states.receive()? {
            let messages = self.translator.take_state(state.message().head, now_ns);
            self.publish(node, messages);
        }
        while let Some(health) = self.health.receive()? {
            let messages = vec![self.translator.health(health.message().head)];
            self.publish(node, messages);
        }
        Ok(())
    }

    fn publish(&mut self, node: &mut Node, messages: Vec<Message>) {
        for message in self.translator.with_mounting(messages) {
            let mut topics = LIVE_TOPICS.iter();
            let Some((topic, name)) = topics.find(|(topic, _)| topic.name == message.topic) else {
                continue;
            };
            node.send(Frame {
                time_ns: message.stamp_ns,
                message: message.bytes,
                ..frame(topic, name)
            });
        }
    }
}

/// What tells ROS of the topics before their first messages.
pub fn announcements() -> Vec<Frame> {
    let topics = LIVE_TOPICS.iter();
    let announced = topics.map(|(topic, name)| Frame {
        is_announcement: true,
        ..frame(topic, name)
    });
    announced.collect()
}

fn frame(topic: &Topic, name: &str) -> Frame {
    Frame {
        is_latched: topic.is_latched,
        topic: name.to_owned(),
        type_name: format!("{}/{}", topic.kind.package, topic.kind.name),
        ..Frame::default()
    }
}
