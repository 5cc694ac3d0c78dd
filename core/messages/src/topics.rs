//! Every topic of ours, once: its messages and how they are carried. What handles all topics
//! (quality of service, the log's layouts, the recorder, `randt top`) takes them from here.

use crate::{
    Correction, GRAPH_ENTRIES_MAX, GraphEntry, GraphHead, HEALTH_PORTS, ImuSample, KeyframeHead,
    KeyframePoint, LogDrop, OdometryState, PointsHead, Return, ScanHead, StageHealth, TILE_CELLS,
    TileHead, Topic, TruthPose, Twist, radar::MAX_RETURNS, topic,
};

/// Readers of a topic: its stage, recorder, view, supervisor and a person's tool or two.
const READERS: usize = 6;
/// Readers of a topic that every `randt top` reads: people's tools may never take the place of a
/// stage that comes back.
const WATCHED: usize = 16;

/// How a topic is carried on the bus.
///
/// Under safe overflow a late reader gets at most its own buffer of the history, so the two go
/// together. A reader's buffer lasts as long as a stage may be stopped, a writer's history as long
/// as the recorder may be away: 5 s and more. Under load the recorder's restart takes up to 2.3 s,
/// and it may be killed again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicQos {
    /// Messages that wait for a reader.
    pub buffer: usize,
    /// Messages that a reader gets at once when it joins.
    pub history: usize,
    /// Readers at once.
    pub readers: usize,
    /// Items of a message as they usually are: iSDR-C, Navtech.
    pub usual_items: [usize; 2],
    /// Messages per second, at most.
    pub rate_max_hz: usize,
}

impl TopicQos {
    /// For a topic that is not registered, such as a test's.
    pub const UNREGISTERED: Self = Self {
        buffer: 16,
        history: 1,
        readers: READERS,
        usual_items: [0, 0],
        rate_max_hz: 0,
    };
}

/// A topic of the bus without its types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusTopic {
    /// Name with version.
    pub name: &'static str,
    /// Name and layout of its messages in this build.
    pub type_name: &'static str,
    /// Bytes of the head.
    pub head_bytes: usize,
    /// Bytes of an item.
    pub item_bytes: usize,
    /// Most items in one message.
    pub max_items: usize,
    /// How it is carried.
    pub qos: TopicQos,
}

impl BusTopic {
    /// The description of a topic's messages, carried as `qos` says.
    pub const fn new<T: Topic>(qos: TopicQos) -> Self {
        Self {
            name: T::NAME,
            type_name: T::TYPE_NAME,
            head_bytes: size_of::<T::Head>(),
            item_bytes: size_of::<T::Item>(),
            max_items: T::MAX_ITEMS,
            qos,
        }
    }
}

/// Does something for each of several topics, with its types.
pub trait TopicVisitor {
    /// Why it stops.
    type Error;

    /// Handles one topic.
    fn visit<T: Topic>(&mut self) -> Result<(), Self::Error>;
}

/// Registers topics in the order of the data's way: those of the bus with how they are carried,
/// those of logs alone.
macro_rules! topics {
    (
        bus { $(
            $(#[$bus_meta:meta])*
            $bus:ident = $bus_name:literal : $bus_head:ty, [$bus_item:ty; $bus_max:expr], $qos:expr;
        )+ }
        log { $(
            $(#[$log_meta:meta])*
            $log:ident = $log_name:literal : $log_head:ty, [$log_item:ty; $log_max:expr];
        )+ }
    ) => {
        topic! {
            $( $(#[$bus_meta])* $bus = $bus_name: $bus_head, [$bus_item; $bus_max]; )+
            $( $(#[$log_meta])* $log = $log_name: $log_head, [$log_item; $log_max]; )+
        }

        /// Every topic of the bus.
        pub const BUS_TOPICS: &[BusTopic] = &[$( BusTopic::new::<$bus>($qos) ),+];

        /// Visits every topic of the bus, until an error.
        pub fn visit_bus_topics<V: TopicVisitor>(visitor: &mut V) -> Result<(), V::Error> {
            $( visitor.visit::<$bus>()?; )+
            Ok(())
        }

        /// Visits every topic that a log may hold, until an error.
        pub fn visit_log_topics<V: TopicVisitor>(visitor: &mut V) -> Result<(), V::Error> {
            visit_bus_topics(visitor)?;
            $( visitor.visit::<$log>()?; )+
            Ok(())
        }
    };
}

topics! {
    bus {
        /// Every return of a sweep, 4-5 Hz.
        RadarScan = "radar/scan/v1": ScanHead, [Return; MAX_RETURNS], TopicQos {
            // 6 s; 10,000 returns of an iSDR-C, 30,000 of a Navtech above its floor.
            buffer: 32, history: 32, readers: READERS, usual_items: [10_000, 30_000], rate_max_hz: 5,
        };
        /// Topic of [`ImuSample`], about 250 Hz.
        ImuSampleTopic = "imu/sample/v1": ImuSample, [(); 0], TopicQos {
            // 8 s.
            buffer: 2048, history: 2048, readers: READERS, usual_items: [0, 0], rate_max_hz: 250,
        };
        /// Topic of [`Twist`], 10 to 200 Hz where the robot has it.
        TwistTopic = "robot/twist/v1": Twist, [(); 0], TopicQos {
            // 5 s at 200 Hz.
            buffer: 1024, history: 1024, readers: READERS, usual_items: [0, 0], rate_max_hz: 200,
        };
        /// The filtered returns of a sweep, still polar.
        RadarPoints = "radar/points/v1": PointsHead, [Return; MAX_RETURNS], TopicQos {
            buffer: 32, history: 32, readers: READERS, usual_items: [2_500, 6_000], rate_max_hz: 5,
        };
        /// Topic of [`OdometryState`], once per scan.
        OdometryStateTopic = "odometry/state/v1": OdometryState, [(); 0], TopicQos {
            buffer: 32, history: 32, readers: WATCHED, usual_items: [0, 0], rate_max_hz: 5,
        };
        /// A keyframe, published when its scan leaves the window.
        Keyframe = "odometry/keyframe/v1": KeyframeHead, [KeyframePoint; MAX_RETURNS], TopicQos {
            // At most one per scan; the mapper gets older ones from the ring of keyframes.
            buffer: 64, history: 32, readers: READERS, usual_items: [2_500, 6_000], rate_max_hz: 5,
        };
        /// Topic of [`Correction`], on change.
        MapperCorrection = "mapper/correction/v1": Correction, [(); 0], TopicQos {
            // At most one per keyframe.
            buffer: 32, history: 32, readers: WATCHED, usual_items: [0, 0], rate_max_hz: 5,
        };
        /// Topic of the pose graph, on change and at least twice a second.
        MapperGraph = "mapper/graph/v1": GraphHead, [GraphEntry; GRAPH_ENTRIES_MAX], TopicQos {
            // Twice a second, with each keyframe, and every 2 s the whole graph in pages.
            buffer: 64, history: 64, readers: WATCHED, usual_items: [300, 300], rate_max_hz: 12,
        };
        /// Topic of the occupancy grid's tiles that changed, paced.
        MapperGrid = "mapper/grid/v1": TileHead, [u8; TILE_CELLS * TILE_CELLS], TopicQos {
            // Tiles that have changed, every 2 s: while there are many, 160 a second; the map of a
            // drive changes by 200 tiles in 2 s at most.
            buffer: 512, history: 512, readers: READERS, usual_items: [4096, 4096], rate_max_hz: 100,
        };
        /// Topic of [`StageHealth`]: many writers, twice a second each, and one at once when the
        /// loop is entered.
        StageHealthTopic = "stage/health/v1": StageHealth, [(); 0], TopicQos {
            buffer: 16, history: 16, readers: WATCHED, usual_items: [0, 0], rate_max_hz: 2,
        };
    }
    log {
        /// Topic of [`TruthPose`].
        TruthPoseTopic = "truth/pose/v1": TruthPose, [(); 0];
        /// Topic of [`LogDrop`]; only in logs, never on the bus.
        LogDropTopic = "log/drop/v1": LogDrop, [(); 0];
    }
}

// The recorder's health has a port for every topic.
const _: () = assert!(BUS_TOPICS.len() <= HEALTH_PORTS);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_topic_is_registered_once() {
        for (i, topic) in BUS_TOPICS.iter().enumerate() {
            assert!(BUS_TOPICS[i + 1..].iter().all(|o| o.name != topic.name));
            assert!(topic.qos.history <= topic.qos.buffer, "{}", topic.name);
        }
    }

    #[test]
    fn histories_outlast_a_recorder_that_is_away_for_five_seconds() {
        for topic in BUS_TOPICS {
            let reach = topic.qos.history.min(topic.qos.buffer);
            assert!(topic.qos.rate_max_hz > 0, "{}", topic.name);
            assert!(
                reach >= 5 * topic.qos.rate_max_hz,
                "{}: {reach}",
                topic.name
            );
        }
    }

    #[test]
    fn buffers_outlast_a_stage_that_is_stopped_for_five_seconds() {
        let buffer = |name| {
            let found = BUS_TOPICS.iter().find(|topic| topic.name == name);
            found.unwrap().qos.buffer
        };
        assert!(buffer("radar/scan/v1") > 5 * 5 && buffer("radar/points/v1") > 5 * 5);
        assert!(buffer("imu/sample/v1") > 5 * 250);
    }
}
