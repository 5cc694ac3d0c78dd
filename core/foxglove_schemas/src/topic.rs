//! The topics that viewers see, each with its schema and its rate: what a live view and a
//! recording share, so that one layout shows both.

use crate::channel;
use foxglove::messages::{FrameTransforms, Log, PointCloud, PoseInFrame, SceneUpdate};
use randt_log::Channel;
use randt_messages::{OdometryStateTopic, Topic};
use randt_ros_messages as ros;

/// The live pose.
pub const POSE: &str = "view/pose";
/// How the frames lie in each other.
pub const TRANSFORMS: &str = "view/transforms";
/// The filtered returns.
pub const POINTS: &str = "view/points";
/// The occupancy grid.
pub const GRID: &str = "view/grid";
/// The cells of odometry's submap.
pub const CELLS: &str = "view/cells";
/// Keyframes and the edges of odometry between them.
pub const GRAPH: &str = "view/graph";
/// Loops in force.
pub const LOOPS: &str = "view/loops";

const S: i64 = 1_000_000_000;
/// A cloud goes once a second, give or take a sweep: it is the largest of what always changes.
pub const CLOUD_PERIOD_NS: i64 = 950_000_000;

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
    /// The state itself, with every number, for plots.
    State,
    /// The filtered returns, thinned where the link is slow.
    Points,
    /// Path and loops.
    Path,
    /// The occupancy grid: live tile by tile, in a recording whole.
    Grid,
    /// The cells of odometry's submap, where the link takes them.
    Cells,
}

/// A row of the table.
struct Row {
    name: &'static str,
    channel: fn(&str) -> Channel,
    /// From one message to the next at least, ns; 0 where a message goes with everything new.
    period_ns: i64,
}

/// What a recording has for viewers. Its messages are ROS's, as all others of a log: viewers show
/// them, and what reads ROS 2 bags reads the whole log.
const RECORDED: [(&str, ros::Definition); 7] = [
    (TRANSFORMS, ros::TRANSFORMS),
    (POSE, ros::POSE),
    (POINTS, ros::CLOUD),
    (GRID, ros::OCCUPANCY_GRID),
    (CELLS, ros::MARKERS),
    (GRAPH, ros::MARKERS),
    (LOOPS, ros::MARKERS),
];

/// Topic and type of each recorded topic for viewers.
pub fn recorded_channels() -> [Channel; RECORDED.len()] {
    RECORDED.map(|(topic, definition)| definition.channel(topic))
}

impl ViewerTopic {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Status,
        Self::Log,
        Self::Transforms,
        Self::Pose,
        Self::State,
        Self::Points,
        Self::Path,
        Self::Grid,
        Self::Cells,
    ];

    /// The table.
    fn row(self) -> Row {
        let row = |name, channel, period_ns| Row {
            name,
            channel,
            period_ns,
        };
        // As a log has it.
        let own = |_: &str| Channel::from_topic::<OdometryStateTopic>();
        match self {
            Self::Status => row("view/status", channel::<SceneUpdate>, S),
            Self::Log => row("view/log", channel::<Log>, S),
            Self::Transforms => row(TRANSFORMS, channel::<FrameTransforms>, 0),
            Self::Pose => row(POSE, channel::<PoseInFrame>, 0),
            Self::State => row(OdometryStateTopic::NAME, own, 0),
            Self::Points => row(POINTS, channel::<PointCloud>, CLOUD_PERIOD_NS),
            Self::Path => row("view/path", channel::<SceneUpdate>, 0),
            Self::Grid => row(GRID, channel::<SceneUpdate>, 0),
            Self::Cells => row(CELLS, channel::<SceneUpdate>, 5 * S),
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
        (self.row().channel)(self.name())
    }

    /// From one live message to the next at least, ns.
    pub fn live_period_ns(self) -> i64 {
        self.row().period_ns
    }
}
