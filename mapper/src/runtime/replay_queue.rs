//! Keyframes of the journal that a map which has come back has yet to take, in order, packed.

use randt_geometry::Pose2;
use randt_mapper::MapKeyframe;
use randt_mapper::journal::{self, Packed};
use randt_messages::{Keyframe, KeyframeHead, MessageRef};
use std::collections::VecDeque;

/// The keyframes.
pub struct ReplayQueue {
    keyframes: VecDeque<Packed>,
    /// Whether the map is late: they are more than the one that was being taken as the process
    /// ended.
    pub is_late: bool,
}

/// What identifies a keyframe beside its number: two that agree in both are one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyframeFacts {
    pub stamp_ns: i64,
    pub odom_frame_id: u64,
    /// x m, y m, yaw rad in `odom`.
    pub pose: [f64; 3],
}

impl KeyframeFacts {
    pub fn from_keyframe(keyframe: &MapKeyframe) -> Self {
        Self {
            stamp_ns: keyframe.stamp_ns,
            odom_frame_id: keyframe.odom_frame_id,
            pose: keyframe.odom_from_base.to_array(),
        }
    }

    pub fn from_head(head: &KeyframeHead) -> Self {
        Self {
            stamp_ns: head.header.stamp_ns,
            odom_frame_id: head.odom_frame_id,
            pose: Pose2::from_array(head.pose).to_array(),
        }
    }
}

impl From<Vec<Packed>> for ReplayQueue {
    fn from(keyframes: Vec<Packed>) -> Self {
        Self {
            is_late: keyframes.len() > 1,
            keyframes: keyframes.into(),
        }
    }
}

impl ReplayQueue {
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.keyframes.push_back(Packed::from_message(keyframe));
    }

    /// Takes the next one.
    pub fn pop(&mut self) -> Option<Packed> {
        let next = self.keyframes.pop_front();
        self.is_late |= self.keyframes.len() > 1;
        next
    }

    /// Whether the last of many was taken; true once.
    pub fn has_ended(&mut self) -> bool {
        self.keyframes.is_empty() && std::mem::take(&mut self.is_late)
    }

    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    pub fn newest(&self) -> Option<KeyframeFacts> {
        let mut head = KeyframeHead::default();
        let is_read = journal::read_head(self.keyframes.back()?, &mut head);
        is_read.then(|| KeyframeFacts::from_head(&head))
    }

    /// The one with a number.
    pub fn find(&self, id: u64) -> Option<KeyframeFacts> {
        let mut head = KeyframeHead::default();
        let mut keyframes = self.keyframes.iter();
        let is_found =
            keyframes.any(|packed| journal::read_head(packed, &mut head) && head.id == id);
        is_found.then(|| KeyframeFacts::from_head(&head))
    }
}
