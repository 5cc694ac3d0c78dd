//! The topics that viewers see, each with its schema and its rate: what a live view and a
//! recording share, so that one layout shows both.

use crate::channel;
use foxglove::Encode;
use foxglove::messages::{FrameTransforms, Grid, Log, PointCloud, PoseInFrame, SceneUpdate};
use randt_log::Channel;

/// The live pose.
pub const POSE: &str = "view/pose";
/// How the frames lie in each other.
pub const TRANSFORMS: &str = "view/transforms";
/// The filtered returns.
pub const POINTS: &str = "view/points";
/// The occupancy grid.
pub const GRID: &str = "view/grid";

const S: i64 = 1_000_000_000;
/// A cloud goes once a second, give or take a sweep: it is the largest of what always changes.
const CLOUD_PERIOD_NS: i64 = 950_000_000;

/// A topic for viewers, in the order of importance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ViewerTopic {
    /// How old and how good the pose is, as text at the robot.
    Status,
    /// The same as lines of a log.
    Log,
    /// All frames.
    Transforms,
    /// The pose.
    Pose,
    /// The filtered returns, thinned where the link is slow.
    Points,
    /// Path and loops.
    Path,
    /// The occupancy grid: live tile by tile, in a recording whole.
    Grid,
}

/// A topic's messages.
#[derive(Clone, Copy)]
struct Stream {
    channel: fn(&str) -> Channel,
    /// From one message to the next at least, ns; 0 where a message goes with everything new.
    period_ns: i64,
}

/// A row of the table.
struct Row {
    name: &'static str,
    live: Stream,
    /// None where a recording does not have it.
    recorded: Option<Stream>,
}

fn stream<T: Encode>(period_ns: i64) -> Stream {
    Stream {
        channel: channel::<T>,
        period_ns,
    }
}

impl ViewerTopic {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Status,
        Self::Log,
        Self::Transforms,
        Self::Pose,
        Self::Points,
        Self::Path,
        Self::Grid,
    ];

    /// The table.
    fn row(self) -> Row {
        let row = |name, live, recorded| Row {
            name,
            live,
            recorded,
        };
        let (transforms, pose) = (stream::<FrameTransforms>(0), stream::<PoseInFrame>(0));
        let points = stream::<PointCloud>(CLOUD_PERIOD_NS);
        match self {
            Self::Status => row("view/status", stream::<SceneUpdate>(S), None),
            Self::Log => row("view/log", stream::<Log>(S), None),
            Self::Transforms => row(TRANSFORMS, transforms, Some(transforms)),
            Self::Pose => row(POSE, pose, Some(pose)),
            Self::Points => row(POINTS, points, Some(points)),
            Self::Path => row("view/path", stream::<SceneUpdate>(0), None),
            Self::Grid => row(GRID, stream::<SceneUpdate>(0), Some(stream::<Grid>(2 * S))),
        }
    }

    /// The number of its live channel.
    pub fn channel_id(self) -> u32 {
        self as u32 + 1
    }

    /// The topic whose live channel has this number.
    pub fn from_channel_id(id: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.channel_id() == id)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Topic and schema, live.
    pub fn live_channel(self) -> Channel {
        (self.row().live.channel)(self.name())
    }

    /// From one live message to the next at least, ns.
    pub fn live_period_ns(self) -> i64 {
        self.row().live.period_ns
    }

    /// Topic and schema of a recorded topic for viewers by its name; none for any other.
    pub fn recorded_channel(name: &str) -> Option<Channel> {
        let topic = Self::ALL.into_iter().find(|topic| topic.name() == name)?;
        Some((topic.row().recorded?.channel)(name))
    }

    /// From one recorded message to the next at least, ns.
    pub fn recorded_period_ns(self) -> i64 {
        self.row().recorded.map_or(0, |stream| stream.period_ns)
    }
}
