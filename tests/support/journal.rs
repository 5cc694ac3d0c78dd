//! What a map's journal holds.

use randt_mapper::journal::{self, Kind};
use randt_messages::{KeyframeHead, Message};
use std::fs;
use std::path::Path;

/// The head of every keyframe; none where there is no journal yet.
pub fn heads(path: &Path) -> Vec<KeyframeHead> {
    let bytes = fs::read(path).unwrap_or_default();
    let Ok((_, records)) = journal::records(&bytes) else {
        return Vec::new();
    };
    let mut message = Message::default();
    let read = records.of_kind(Kind::Keyframe).map(|record| {
        assert!(journal::read_keyframe(record.payload, &mut message));
        *message.head
    });
    read.collect()
}

/// Number and odometry frame of every keyframe.
pub fn keyframes(path: &Path) -> Vec<(u64, u64)> {
    let heads = heads(path).into_iter();
    heads.map(|head| (head.id, head.odom_frame_id)).collect()
}
