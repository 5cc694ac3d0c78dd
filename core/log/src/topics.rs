//! Every topic that a log of ours may hold.

use crate::Channel;
use randt_messages::{
    ImuSampleTopic, Keyframe, LogDropTopic, MapperCorrection, MapperGraph, MapperGrid,
    OdometryStateTopic, RadarPoints, RadarScan, StageHealthTopic, Topic, TruthPoseTopic,
};

macro_rules! topics {
    ($($topic:ty),+ $(,)?) => {
        /// Every topic of ours that a log may hold, with its channel.
        pub fn channels() -> Vec<Channel> {
            vec![$(Channel::from_topic::<$topic>()),+]
        }

        /// The channel of one of our topics by its name.
        pub fn channel_of(topic: &str) -> Option<Channel> {
            match topic {
                $(name if name == <$topic>::NAME => Some(Channel::from_topic::<$topic>()),)+
                _ => None,
            }
        }
    };
}

topics!(
    RadarScan,
    ImuSampleTopic,
    RadarPoints,
    OdometryStateTopic,
    Keyframe,
    MapperCorrection,
    MapperGraph,
    MapperGrid,
    StageHealthTopic,
    TruthPoseTopic,
    LogDropTopic,
);
