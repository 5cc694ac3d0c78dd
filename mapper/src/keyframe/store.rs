//! All keyframes of the map, in order.

use super::{MapKeyframe, Observation};
use crate::index::KeyframeIdx;
use randt_messages::KeyframeHead;
use randt_persist::persist;
use std::ops::Deref;

/// The keyframes of the map, and how many were left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeyframeStore {
    keyframes: Vec<MapKeyframe>,
    /// Keyframes left out.
    pub rejected: u64,
}

/// What a snapshot has of the store: which of the journal's keyframes the map has.
#[derive(Debug, Default)]
pub(crate) struct SavedKeyframes {
    /// Runs of rising numbers, each by its first number and its length.
    id_runs: Vec<(u64, u64)>,
    /// Stamp of the newest keyframe: numbers begin anew with every mission, stamps do not.
    newest_ns: i64,
    rejected: u64,
}
persist!(SavedKeyframes {
    id_runs,
    newest_ns,
    rejected
});

impl Deref for KeyframeStore {
    type Target = [MapKeyframe];

    fn deref(&self) -> &[MapKeyframe] {
        &self.keyframes
    }
}

impl KeyframeStore {
    /// Whether a keyframe can follow those that are there; others are left out.
    pub fn is_next(&self, head: &KeyframeHead) -> bool {
        // A clock that was set back opens a new frame of odometry.
        let rises = self.last().is_none_or(|before| {
            head.id > before.keyframe_id
                && (head.odom_frame_id > before.odom_frame_id
                    || head.odom_frame_id == before.odom_frame_id
                        && head.header.stamp_ns > before.stamp_ns)
        });
        rises && head.pose.iter().all(|value| value.is_finite())
    }

    /// Takes the next keyframe.
    pub fn push(&mut self, keyframe: MapKeyframe) {
        self.keyframes.push(keyframe);
    }

    /// Forgets what a keyframe saw.
    pub fn forget(&mut self, keyframe: KeyframeIdx) {
        if let Some(keyframe) = self.keyframes.get_mut(keyframe.0) {
            keyframe.observation = Observation::default().into();
        }
    }

    /// How many keyframes it was given, those left out included.
    pub fn taken(&self) -> usize {
        self.len() + self.rejected as usize
    }

    /// The index of the newest keyframe.
    pub fn newest(&self) -> Option<KeyframeIdx> {
        self.len().checked_sub(1).map(KeyframeIdx)
    }

    /// The index of the keyframe that odometry gave a number.
    pub fn find(&self, keyframe_id: u64) -> Option<KeyframeIdx> {
        let found = self.binary_search_by_key(&keyframe_id, |keyframe| keyframe.keyframe_id);
        found.ok().map(KeyframeIdx)
    }

    /// Path over all keyframes, m.
    pub fn path_m(&self) -> f64 {
        self.last().map_or(0.0, |keyframe| keyframe.path_m)
    }

    /// What a snapshot has of the store.
    pub fn saved(&self) -> SavedKeyframes {
        let mut id_runs: Vec<(u64, u64)> = Vec::new();
        for id in self.iter().map(|keyframe| keyframe.keyframe_id) {
            match id_runs.last_mut() {
                Some((first, length)) if first.checked_add(*length) == Some(id) => *length += 1,
                _ => id_runs.push((id, 1)),
            }
        }
        SavedKeyframes {
            id_runs,
            newest_ns: self.newest_ns(),
            rejected: self.rejected,
        }
    }

    /// Whether these are the keyframes that were saved, of as many as the mapper had taken; then
    /// those left out count.
    pub fn restore(&mut self, saved: &SavedKeyframes, taken: u64) -> Option<()> {
        self.rejected = saved.rejected;
        let is_whole = taken.checked_sub(self.len() as u64)? == saved.rejected;
        (is_whole && self.newest_ns() == saved.newest_ns).then_some(())
    }

    fn newest_ns(&self) -> i64 {
        self.last().map_or(0, |keyframe| keyframe.stamp_ns)
    }
}

impl SavedKeyframes {
    /// The numbers of the keyframes, rising.
    pub fn ids(&self) -> impl Iterator<Item = u64> {
        let runs = self.id_runs.iter();
        runs.flat_map(|(first, length)| (0..*length).map(|n| first.wrapping_add(n)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{Keyframe, Message};

    fn store(ids: &[u64]) -> KeyframeStore {
        let mut store = KeyframeStore::default();
        for (stamp_ns, id) in (30..).zip(ids) {
            let mut message = Message::<Keyframe>::default();
            message.head.id = *id;
            message.head.header.stamp_ns = stamp_ns;
            assert!(store.is_next(&message.head));
            store.push(MapKeyframe::new(message.as_ref(), store.last()));
        }
        store
    }

    #[test]
    fn numbers_are_saved_as_runs_and_come_back() {
        let ids = [0, 1, 2, 7, 8, u64::MAX];
        let mut store = store(&ids);
        store.rejected += 1;
        let saved = store.saved();
        assert_eq!(saved.id_runs, [(0, 3), (7, 2), (u64::MAX, 1)]);
        assert_eq!(saved.ids().collect::<Vec<_>>(), ids);
        assert!(store.restore(&saved, 7).is_some());
        assert!(store.restore(&saved, 8).is_none());
        assert_eq!((store.taken(), store.find(7)), (7, Some(KeyframeIdx(3))));
    }

    #[test]
    fn what_cannot_follow_is_no_next_one() {
        let store = store(&[3]);
        let mut head = KeyframeHead::default();
        (head.id, head.header.stamp_ns) = (4, 31);
        assert!(store.is_next(&head));
        head.header.stamp_ns = 30;
        assert!(!store.is_next(&head), "a stamp again");
        head.odom_frame_id = 1;
        assert!(store.is_next(&head), "a clock that was set back");
        head.pose[0] = f64::NAN;
        assert!(!store.is_next(&head));
    }
}
