//! A topic of a log: its type, and how its messages are laid out.

use crate::description::LAYOUT;
use crate::stored_layout::StoredLayout;
use crate::{describe, ros_type};
use randt_messages::Topic;
use std::collections::BTreeMap;

/// How our messages are serialised, and how their schema is written.
const ENCODING: &str = "cdr";
const SCHEMA_ENCODING: &str = "ros2msg";
/// The same up to 0.1.0: as on the bus, with a table of offsets.
const BUS_ENCODING: &str = "randt";
const TABLE_ENCODING: &str = "randt-layout";

/// A topic as a log declares it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// Name with version.
    pub topic: String,
    /// Type name; empty where the log has none.
    pub type_name: String,
    /// How its messages are serialised: `cdr` for ours and in ROS 2 bags, `ros1` in others,
    /// `protobuf` for viewers, `randt` for ours up to 0.1.0.
    pub message_encoding: String,
    /// How the schema is written: `ros2msg`, `protobuf`, `randt-layout`; empty where there is
    /// none.
    pub schema_encoding: String,
    /// What a message holds, for readers that do not know the topic.
    pub schema: Vec<u8>,
    /// What else is known of it, such as a ROS publisher's quality of service.
    pub metadata: BTreeMap<String, String>,
    /// Messages read so far.
    pub messages: u64,
}

impl Channel {
    /// The channel of one of our topics.
    pub fn from_topic<T: Topic>() -> Self {
        Self {
            topic: T::NAME.to_owned(),
            type_name: ros_type::<T>(),
            message_encoding: ENCODING.to_owned(),
            schema_encoding: SCHEMA_ENCODING.to_owned(),
            schema: describe::<T>().into_bytes(),
            metadata: BTreeMap::new(),
            messages: 0,
        }
    }

    /// Whether its messages are of our bus, of this build or of another.
    pub fn is_ours(&self) -> bool {
        self.is_of_former_logs() || self.named_layout().is_some()
    }

    /// The name of its messages' layout, with its hash; of those that are not ours their type's.
    pub fn layout(&self) -> &str {
        self.named_layout().unwrap_or(&self.type_name)
    }

    /// How its messages are laid out, where they are ours.
    pub fn stored_layout(&self) -> Option<StoredLayout> {
        let text = std::str::from_utf8(&self.schema).ok()?;
        match self.schema_encoding.as_str() {
            SCHEMA_ENCODING => StoredLayout::parse(text),
            TABLE_ENCODING => StoredLayout::parse_table(text),
            _ => None,
        }
    }

    /// Whether its messages are as they were on the bus.
    pub(crate) fn is_of_former_logs(&self) -> bool {
        self.message_encoding == BUS_ENCODING
    }

    /// Whether its messages have the layout of this name: asked for each message.
    pub(crate) fn has_layout(&self, name: &str) -> bool {
        let rest = self.behind_mark();
        let rest = rest.and_then(|rest| rest.strip_prefix(name.as_bytes()));
        match rest {
            Some(rest) => rest.first() == Some(&b','),
            None => self.is_of_former_logs() && self.type_name == name,
        }
    }

    /// What follows the mark that a definition of ours begins with.
    fn behind_mark(&self) -> Option<&[u8]> {
        let is_ros2 = self.message_encoding == ENCODING && self.schema_encoding == SCHEMA_ENCODING;
        is_ros2.then(|| self.schema.strip_prefix(LAYOUT.as_bytes()))?
    }

    fn named_layout(&self) -> Option<&str> {
        let rest = self.behind_mark()?;
        let end = rest.iter().position(|byte| *byte == b',')?;
        std::str::from_utf8(rest.get(..end)?).ok()
    }
}
