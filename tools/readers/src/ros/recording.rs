//! What a bag of any format gives: serialised messages of named channels, in the order of
//! recording.

use super::twist::TwistKind;
use super::wire::Encoding;
use crate::{Error, counters::Counters};

/// The message types that matter here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Cloud,
    Imu,
    Twist(TwistKind),
    /// Transforms that hold for the whole recording.
    StaticTransforms,
    /// Transforms of which some may never change.
    Transforms,
    Other,
}

impl Kind {
    /// From a topic and its type, in ROS 1's or ROS 2's spelling.
    pub fn from_topic(topic: &str, type_name: &str) -> Self {
        match type_name.replace("/msg/", "/").as_str() {
            "sensor_msgs/PointCloud2" => Self::Cloud,
            "sensor_msgs/Imu" => Self::Imu,
            "nav_msgs/Odometry" => Self::Twist(TwistKind::Odometry),
            "geometry_msgs/TwistStamped" => Self::Twist(TwistKind::Plain),
            "geometry_msgs/TwistWithCovarianceStamped" => Self::Twist(TwistKind::WithCovariance),
            "tf2_msgs/TFMessage" | "tf/tfMessage" if topic.ends_with("tf_static") => {
                Self::StaticTransforms
            }
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Self::Transforms,
            _ => Self::Other,
        }
    }
}

/// One topic of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub topic: String,
    pub type_name: String,
    pub kind: Kind,
    pub encoding: Encoding,
    /// Messages in the recording, by its indices.
    pub messages: u64,
}

/// One message.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Raw<'a> {
    /// Index into [`Recording::channels`].
    pub channel: usize,
    /// When it was recorded, ns.
    pub arrival_ns: i64,
    /// Place in the file, for messages to the user.
    pub offset: u64,
    pub bytes: &'a [u8],
}

/// A bag of any format.
pub(crate) trait Recording {
    /// Kind, such as `ros1-bag`.
    fn format(&self) -> &'static str;

    /// The topics; fixed once it is open.
    fn channels(&self) -> &[Channel];

    /// The next message; damage is counted and stepped over.
    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error>;

    /// Called after the last message: counts damage that only the end showed.
    fn close(&mut self, _tally: &mut Counters) {}

    /// The messages of static transforms, wherever they are in the recording.
    fn static_transforms(&self) -> &[Vec<u8>];
}
