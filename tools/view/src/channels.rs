//! The channels: what is shown.

use randt_foxglove_schemas::{
    FrameTransforms, Log, PointCloud, PoseInFrame, SceneUpdate, channel, topic,
};
use randt_log::Channel;

/// What can be subscribed to, in the order of importance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shown {
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
    /// The occupancy grid's tiles.
    Grid,
}

impl Shown {
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

    /// Its place among all, from 0.
    pub(crate) fn place(self) -> usize {
        self as usize
    }

    /// The channel's number.
    pub fn id(self) -> u32 {
        self as u32 + 1
    }

    /// The channel with this number.
    pub fn of_id(id: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|shown| shown.id() == id)
    }

    /// Its topic.
    pub fn topic(self) -> &'static str {
        match self {
            Self::Status => "view/status",
            Self::Log => "view/log",
            Self::Transforms => topic::TRANSFORMS,
            Self::Pose => topic::POSE,
            Self::Points => topic::POINTS,
            Self::Path => "view/path",
            Self::Grid => topic::GRID,
        }
    }

    /// Topic and schema.
    pub fn channel(self) -> Channel {
        let topic = self.topic();
        match self {
            Self::Status | Self::Path | Self::Grid => channel::<SceneUpdate>(topic),
            Self::Log => channel::<Log>(topic),
            Self::Transforms => channel::<FrameTransforms>(topic),
            Self::Pose => channel::<PoseInFrame>(topic),
            Self::Points => channel::<PointCloud>(topic),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    /// Everything in a layout that is called like a topic of ours.
    fn topics(of: &Value, found: &mut Vec<String>) {
        match of {
            Value::Object(entries) => {
                found.extend(
                    entries
                        .keys()
                        .filter(|key| key.starts_with("view/"))
                        .cloned(),
                );
                entries.values().for_each(|value| topics(value, found));
            }
            Value::Array(values) => values.iter().for_each(|value| topics(value, found)),
            Value::String(text) if text.starts_with("view/") => found.push(text.clone()),
            _ => {}
        }
    }

    #[test]
    fn the_layout_shows_what_there_is_and_all_of_it() {
        let layout = include_str!("../../../docs/view/lichtblick.json");
        let layout: Value = serde_json::from_str(layout).unwrap();
        let mut found = Vec::new();
        topics(&layout, &mut found);
        for shown in Shown::ALL {
            assert!(
                found.iter().any(|topic| topic == shown.topic()),
                "{shown:?}"
            );
            assert_eq!(Shown::of_id(shown.id()), Some(shown));
        }
        for topic in found {
            assert!(
                Shown::ALL.iter().any(|shown| shown.topic() == topic),
                "{topic}"
            );
        }
        // Each panel of the layout has its settings.
        for panel in ["first", "second"] {
            let name = layout["layout"][panel].as_str().unwrap();
            assert!(layout["configById"][name].is_object(), "{name}");
        }
    }
}
