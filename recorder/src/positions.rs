//! How far each publisher has been followed: the last message of each topic, by its epoch and
//! sequence.

use crate::Raw;
use bytemuck::{Zeroable, pod_read_unaligned};
use randt_messages::{
    Header, Keyframe, KeyframeHead, LastRecorded, Layout, OdometryState, OdometryStateTopic,
    StageHealth, StageHealthTopic, Topic, health::fixed_text,
};
use std::mem::offset_of;

/// Publishers that are remembered: one a topic, and of `stage/health` one a stage.
const PUBLISHERS_MAX: usize = 64;
/// In front of the entries: the layout's hash, and the number of entries.
const HEAD_BYTES: usize = 8 + size_of::<u64>();

/// The last message of every publisher.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Positions(Vec<LastRecorded>);

impl Positions {
    /// Room that they take at most, bytes.
    pub const BYTES_MAX: usize = HEAD_BYTES + PUBLISHERS_MAX * size_of::<LastRecorded>();

    /// A message's position; `None` for one that was never published, such as `log/drop`.
    pub fn position_of(raw: &Raw) -> Option<LastRecorded> {
        let head = raw.head()?;
        let header: Header = pod_read_unaligned(head.get(..size_of::<Header>())?);
        let number = |at: usize| Some(u64::from_le_bytes(*head.get(at..)?.first_chunk()?));
        let mut last = LastRecorded {
            topic: fixed_text(raw.topic),
            epoch: header.epoch,
            sequence: header.sequence,
            published_ns: header.published_ns,
            ..LastRecorded::zeroed()
        };
        if raw.topic == OdometryStateTopic::NAME {
            last.id = number(offset_of!(OdometryState, id))?;
        } else if raw.topic == Keyframe::NAME {
            last.id = number(offset_of!(KeyframeHead, id))?;
        } else if raw.topic == StageHealthTopic::NAME {
            let name = head.get(offset_of!(StageHealth, name)..)?;
            last.writer = *name.first_chunk()?;
        }
        (header.epoch != 0).then_some(last)
    }

    /// The last message of the publisher of `message`.
    pub fn last(&self, message: &LastRecorded) -> Option<&LastRecorded> {
        self.0.iter().find(|last| is_same_publisher(last, message))
    }

    /// Takes a message; one that is older than the last of its publisher changes nothing.
    pub fn put(&mut self, message: LastRecorded) {
        let same = |last: &&mut LastRecorded| is_same_publisher(last, &message);
        match self.0.iter_mut().find(same) {
            Some(last) if (message.epoch, message.sequence) > (last.epoch, last.sequence) => {
                *last = message;
            }
            Some(_) => {}
            None => {
                if self.0.len() == PUBLISHERS_MAX {
                    self.forget_oldest();
                }
                self.0.push(message);
            }
        }
    }

    fn forget_oldest(&mut self) {
        let oldest = (0..self.0.len()).min_by_key(|i| self.0.get(*i).map(|last| last.published_ns));
        if let Some(oldest) = oldest {
            self.0.swap_remove(oldest);
        }
    }

    /// When the newest of all was published, ns; 0 where there is none.
    pub fn newest_ns(&self) -> i64 {
        let published = self.0.iter().map(|last| last.published_ns);
        published.max().unwrap_or(0)
    }

    /// As bytes at the beginning of a buffer with room for [`Self::BYTES_MAX`]; gives how many.
    pub fn write(&self, out: &mut [u8]) -> usize {
        let head = [LastRecorded::HASH, self.0.len() as u64].map(u64::to_le_bytes);
        let bytes = head.as_flattened().iter();
        let bytes = bytes.chain(bytemuck::cast_slice::<_, u8>(&self.0));
        let written = out.iter_mut().zip(bytes).map(|(to, from)| *to = *from);
        written.count()
    }

    /// From bytes that this layout has written.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (hash, rest) = bytes.split_first_chunk()?;
        let (count, rest) = rest.split_first_chunk()?;
        let count = u64::from_le_bytes(*count).min(PUBLISHERS_MAX as u64) as usize;
        let entries = rest.chunks_exact(size_of::<LastRecorded>()).take(count);
        let entries: Vec<_> = entries.map(pod_read_unaligned).collect();
        let is_whole = u64::from_le_bytes(*hash) == LastRecorded::HASH && entries.len() == count;
        is_whole.then_some(Self(entries))
    }
}

fn is_same_publisher(a: &LastRecorded, b: &LastRecorded) -> bool {
    (a.topic, a.writer) == (b.topic, b.writer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Message;

    fn state(epoch: u64, sequence: u64, id: u64) -> LastRecorded {
        let mut state = Message::<OdometryStateTopic>::default();
        (state.head.header.epoch, state.head.header.sequence) = (epoch, sequence);
        (state.head.header.published_ns, state.head.id) = (sequence as i64, id);
        Positions::position_of(&Raw::from_message(state.as_ref())).unwrap()
    }

    fn health(name: &str, epoch: u64) -> LastRecorded {
        let mut health = Message::<StageHealthTopic>::default();
        (health.head.name, health.head.header.epoch) = (fixed_text(name), epoch);
        Positions::position_of(&Raw::from_message(health.as_ref())).unwrap()
    }

    #[test]
    fn the_newest_message_of_each_publisher_stays_and_survives_as_bytes() {
        let mut positions = Positions::default();
        for message in [state(3, 7, 40), state(3, 6, 39), state(2, 90, 12)] {
            positions.put(message);
        }
        positions.put(health("filter", 8));
        positions.put(health("mapper", 9));
        let last = positions.last(&state(1, 0, 0)).unwrap();
        assert_eq!((last.epoch, last.sequence, last.id), (3, 7, 40));
        assert_eq!(positions.last(&health("filter", 1)).unwrap().epoch, 8);
        assert_eq!(positions.newest_ns(), 7);

        let mut bytes = vec![0; Positions::BYTES_MAX];
        let count = positions.write(&mut bytes);
        assert_eq!(Positions::read(&bytes[..count]), Some(positions));
        assert_eq!(Positions::read(&bytes[..count - 1]), None);
        bytes[0] ^= 1;
        assert_eq!(Positions::read(&bytes[..count]), None, "another layout's");
    }

    #[test]
    fn more_publishers_than_there_is_room_for_replace_the_oldest() {
        let mut positions = Positions::default();
        for stage in 0..PUBLISHERS_MAX as u64 + 5 {
            let mut health = health(&format!("stage-{stage}"), 1);
            health.published_ns = stage as i64 + 1;
            positions.put(health);
        }
        let mut bytes = vec![0; Positions::BYTES_MAX];
        assert_eq!(positions.write(&mut bytes), Positions::BYTES_MAX);
        assert_eq!(positions.last(&health("stage-4", 1)), None);
        assert!(positions.last(&health("stage-5", 1)).is_some());
    }

    #[test]
    fn what_was_never_published_has_no_position() {
        let state = Message::<OdometryStateTopic>::default();
        assert_eq!(
            Positions::position_of(&Raw::from_message(state.as_ref())),
            None
        );
    }
}
