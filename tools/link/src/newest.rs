//! Topics of which only the newest is sent: of each key the newest message waits, older ones give
//! way.

use crate::bucket::Bucket;
use crate::frame::{Entry, NewestMessage};
use std::collections::{BTreeMap, VecDeque};

/// A message that may be on its way, by its topic, key and version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    pub topic: u8,
    key: u64,
    version: u64,
}

/// What is known of one key.
#[derive(Debug)]
struct KeptMessage {
    message: Vec<u8>,
    stamp_ns: i64,
    /// Rises with each message.
    version: u64,
    is_queued: bool,
}

/// One topic.
#[derive(Debug)]
pub struct NewestTopic {
    pub topic: u8,
    /// Whether it goes before everything else, and in time.
    pub is_urgent: bool,
    kept: BTreeMap<u64, KeptMessage>,
    /// Keys that wait; each once, the one that has waited longest first.
    queue: VecDeque<u64>,
    pub bucket: Bucket,
    /// Messages that a newer one has replaced before they went.
    pub replaced: u64,
}

impl NewestTopic {
    /// Without messages. `rate`: bytes a second, 0 for no limit.
    pub fn new(topic: u8, is_urgent: bool, rate: f64) -> Self {
        Self {
            topic,
            is_urgent,
            kept: BTreeMap::new(),
            queue: VecDeque::new(),
            bucket: Bucket::new(rate),
            replaced: 0,
        }
    }

    /// Takes a message.
    pub fn push(&mut self, key: u64, stamp_ns: i64, message: Vec<u8>) {
        let newest = self.kept.entry(key).or_insert_with(|| KeptMessage {
            message: Vec::new(),
            stamp_ns: 0,
            version: 0,
            is_queued: false,
        });
        newest.version += 1;
        newest.message = message;
        newest.stamp_ns = stamp_ns;
        if newest.is_queued {
            self.replaced += 1;
        } else {
            newest.is_queued = true;
            self.queue.push_back(key);
        }
    }

    /// Whether something waits.
    pub fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }

    /// The next one that waits.
    pub fn take(&mut self) -> Option<(Sent, Entry)> {
        let key = self.queue.pop_front()?;
        let newest = self.kept.get_mut(&key)?;
        newest.is_queued = false;
        let sent = Sent {
            topic: self.topic,
            key,
            version: newest.version,
        };
        let newest = NewestMessage {
            topic: self.topic,
            key,
            message: newest.message.clone(),
        };
        Some((sent, Entry::Newest(newest)))
    }

    /// That did not arrive: it goes again, unless a newer one has gone or waits.
    pub fn lost(&mut self, sent: &Sent) {
        if let Some(newest) = self.kept.get_mut(&sent.key)
            && newest.version == sent.version
            && !newest.is_queued
        {
            newest.is_queued = true;
            self.queue.push_front(sent.key);
        }
    }

    /// What is older is void.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        self.kept.retain(|_, newest| newest.stamp_ns >= stamp_ns);
        self.queue.retain(|key| self.kept.contains_key(key));
    }

    /// The other end has nothing: all goes again.
    pub fn queue_all(&mut self) {
        for (key, newest) in &mut self.kept {
            if !std::mem::replace(&mut newest.is_queued, true) {
                self.queue.push_back(*key);
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    fn message(topic: &mut NewestTopic) -> Option<(Sent, u8)> {
        let (sent, entry) = topic.take()?;
        match entry {
            Entry::Newest(newest) => Some((sent, newest.message[0])),
            Entry::Piece(_) => None,
        }
    }

    #[test]
    fn only_the_newest_goes_and_what_was_lost_goes_again_unless_it_is_old() {
        let mut topic = NewestTopic::new(1, false, 0.0);
        topic.push(7, 1, vec![1]);
        topic.push(8, 2, vec![2]);
        topic.push(7, 3, vec![3]);
        assert_eq!(topic.replaced, 1);
        let (first, value) = message(&mut topic).unwrap();
        assert_eq!(value, 3);
        topic.lost(&first);
        let (again, value) = message(&mut topic).unwrap();
        assert_eq!((again, value), (first, 3), "before what waits");
        topic.push(7, 4, vec![4]);
        topic.lost(&again);
        let values: Vec<u8> = std::iter::from_fn(|| message(&mut topic))
            .map(|(_, value)| value)
            .collect();
        assert_eq!(values, [2, 4]);
        assert!(!topic.is_waiting());
        topic.queue_all();
        assert_eq!(topic.queue.len(), 2);
        // Another drive has begun: what is of the one before does not go any more.
        topic.forget_before(3);
        let values: Vec<u8> = std::iter::from_fn(|| message(&mut topic))
            .map(|(_, value)| value)
            .collect();
        assert_eq!(values, [4]);
    }
}
