//! How much a journal has of what.

use super::super::{Contents, read_attached, read_head};
use randt_messages::KeyframeHead;

/// What is in a file.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    pub keyframes: u64,
    /// Of them, those that the last snapshot has.
    pub in_snapshot: u64,
    /// One more than the number of the newest.
    pub end: u64,
    /// Of the keyframes, those with no more than their numbers.
    pub forgotten: u64,
    /// Bytes of all keyframes and of the largest snapshot: one that stands for itself.
    pub keyframe_bytes: u64,
    pub snapshot_bytes: u64,
}

impl Count {
    /// What a journal that was read has.
    pub fn from_contents(contents: &Contents) -> Self {
        let mut head = KeyframeHead::default();
        let newest = contents.keyframes.last();
        let is_read = newest.is_some_and(|packed| read_head(packed, &mut head));
        let end = is_read.then(|| head.id.saturating_add(1));
        let snapshot = contents.snapshots.last();
        let (keyframes, snapshots) = (contents.keyframes.iter(), contents.snapshots.iter());
        Self {
            keyframes: contents.keyframes.len() as u64,
            in_snapshot: snapshot.map_or(0, |(_, before)| *before as u64),
            end: end.unwrap_or(0),
            forgotten: keyframes.filter(|it| read_attached(it).is_some()).count() as u64,
            keyframe_bytes: contents.keyframes.iter().map(|it| it.len() as u64).sum(),
            snapshot_bytes: snapshots.map(|(it, _)| it.len() as u64).max().unwrap_or(0),
        }
    }
}
