//! Keyframes of the journal that a map which has come back has yet to take, in order, packed.

use randt_geometry::Pose2;
use randt_mapper::journal::{self, Packed};
use randt_messages::{Keyframe, KeyframeHead, MessageRef};
use std::collections::VecDeque;

/// The keyframes.
pub struct Behind(VecDeque<Packed>);

/// By what a keyframe is known: two of one number and these are one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts {
    pub stamp_ns: i64,
    pub odom_frame_id: u64,
    /// x m, y m, yaw rad in `odom`.
    pub pose: [f64; 3],
}

impl Facts {
    pub fn of(head: &KeyframeHead) -> Self {
        Self {
            stamp_ns: head.header.stamp_ns,
            odom_frame_id: head.odom_frame_id,
            pose: Pose2::from_array(head.pose).to_array(),
        }
    }
}

impl From<Vec<Packed>> for Behind {
    fn from(keyframes: Vec<Packed>) -> Self {
        Self(keyframes.into())
    }
}

impl Behind {
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.0.push_back(Packed::of(keyframe));
    }

    /// Takes the next one.
    pub fn pop(&mut self) -> Option<Packed> {
        self.0.pop_front()
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn newest(&self) -> Option<Facts> {
        let mut head = KeyframeHead::default();
        let is_read = journal::read_head(self.0.back()?, &mut head);
        is_read.then(|| Facts::of(&head))
    }

    /// The one with a number.
    pub fn find(&self, id: u64) -> Option<Facts> {
        let mut head = KeyframeHead::default();
        let mut keyframes = self.0.iter();
        let is_found =
            keyframes.any(|packed| journal::read_head(packed, &mut head) && head.id == id);
        is_found.then(|| Facts::of(&head))
    }
}
