//! Types of ROS messages: their names and definitions, as bags carry them.

use crate::Style;
use randt_log::Channel;

/// A type of ROS messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Definition {
    /// Package and name.
    pub package: &'static str,
    /// Name in it.
    pub name: &'static str,
    /// What ROS 1 compares before it connects; empty where we write none of it for ROS 1.
    pub md5: &'static str,
    /// The definition, without those of the types inside.
    pub(crate) text: &'static str,
    /// Types inside: the name, then the definition.
    pub(crate) inside: &'static [&'static str],
}

pub(crate) const VECTOR: &str = "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
pub(crate) const POINT: &str = "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";
pub(crate) const QUATERNION: &str =
    "geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
pub(crate) const POSE_INSIDE: &str =
    "geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n";
/// ROS 1 has it as a kind of number.
const TIME: &str = "builtin_interfaces/Time";

impl Definition {
    /// The whole definition, as bags carry it.
    pub fn text(&self, style: Style) -> String {
        let mut text = self.text.to_owned();
        let header: &[&str] = match style {
            Style::Ros1 => &["std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"],
            Style::Cdr => &[
                "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
                "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
            ],
        };
        for inside in self.inside.iter().chain(header) {
            text += &"=".repeat(80);
            text += &format!("\nMSG: {inside}");
        }
        match style {
            Style::Ros1 => text.replace(TIME, "time"),
            Style::Cdr => text,
        }
    }

    /// A topic of this type in a log, for readers of ROS 2.
    pub fn channel(&self, topic: &str) -> Channel {
        Channel {
            topic: topic.to_owned(),
            type_name: format!("{}/msg/{}", self.package, self.name),
            message_encoding: "cdr".to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: self.text(Style::Cdr).into_bytes(),
            ..Channel::default()
        }
    }
}
