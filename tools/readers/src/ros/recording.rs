//! What a bag of any format gives: serialised messages of named channels, in the order of
//! recording.

use super::twist::TwistKind;
use super::wire::Encoding;
use crate::{Error, counters::Counters};

/// The message types that matter here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Sweeps.
    Radar(RadarKind),
    /// The size of a Navtech's bins.
    RadarConfiguration,
    Imu,
    Twist(TwistKind),
    /// Transforms that hold for the whole recording.
    StaticTransforms,
    /// Transforms of which some may never change.
    Transforms,
    Other,
}

/// The message types that hold a radar's sweep, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RadarKind {
    Cloud,
    /// A polar image.
    Image,
    /// A polar image with its encoder and times (navtech_msgs).
    BScan,
    /// One azimuth of a Navtech.
    Fft,
    LaserScan,
}

impl Kind {
    /// From a topic and its type, in ROS 1's or ROS 2's spelling.
    pub fn from_topic(topic: &str, type_name: &str) -> Self {
        // Navtech's messages have been in several packages.
        let own_name = type_name.rsplit('/').next().unwrap_or(type_name);
        match own_name {
            name if name.starts_with("RadarFftData") => return Self::Radar(RadarKind::Fft),
            name if name.starts_with("RadarBScan") => return Self::Radar(RadarKind::BScan),
            name if name.starts_with("RadarConfiguration")
                || name.starts_with("ConfigurationDataMessage") =>
            {
                return Self::RadarConfiguration;
            }
            _ => {}
        }
        match type_name.replace("/msg/", "/").as_str() {
            "sensor_msgs/PointCloud2" => Self::Radar(RadarKind::Cloud),
            "sensor_msgs/Image" => Self::Radar(RadarKind::Image),
            "sensor_msgs/LaserScan" => Self::Radar(RadarKind::LaserScan),
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

    /// Leaves the messages of other channels out, where that saves time.
    fn select(&mut self, _wanted: &[usize]) {}

    /// The first message of each of these channels, as far as it is known.
    fn first_messages(&self, channels: &[usize]) -> Vec<Option<Vec<u8>>> {
        vec![None; channels.len()]
    }

    /// Whether more may come where there is no message now.
    fn is_live(&self) -> bool {
        false
    }
}
