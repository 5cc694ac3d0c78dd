//! Every topic that a log of ours may hold.

use crate::Channel;
use randt_messages::{Topic, TopicVisitor, visit_log_topics};
use std::convert::Infallible;

/// Collects the channel of each topic.
struct Channels(Vec<Channel>);

impl TopicVisitor for Channels {
    type Error = Infallible;

    fn visit<T: Topic>(&mut self) -> Result<(), Infallible> {
        self.0.push(Channel::from_topic::<T>());
        Ok(())
    }
}

/// Every topic of ours that a log may hold, with its channel.
pub fn channels() -> Vec<Channel> {
    let mut channels = Channels(Vec::new());
    let Ok(()) = visit_log_topics(&mut channels);
    channels.0
}

/// The channel of one of our topics by its name.
pub fn channel_of(topic: &str) -> Option<Channel> {
    channels()
        .into_iter()
        .find(|channel| channel.topic == topic)
}
