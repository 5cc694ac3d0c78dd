//! The mapper that was, from its journal.

use super::Mapper;
use super::snapshot::{self, Grown, Memory, Origin};
use crate::{
    Place, RingKey,
    graph::{Edge, PoseGraph},
    journal::{self, Bytes, Contents, Damage, Error, Packed},
};
use randt_config::Config;
use randt_messages::{KeyframeHead, Message};
use std::sync::Arc;

/// Own snapshots that are tried before all keyframes are pushed anew: one always fits, unless something is badly wrong.
const TRIED_MAX: usize = 2;

/// Why a snapshot was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassedOver {
    /// Another configuration has made it, or a build whose snapshots look otherwise.
    Foreign,
    /// It does not fit the keyframes before it.
    Unfit,
}

/// How a mapper came back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Restored {
    /// Keyframes of the journal.
    pub keyframes: u64,
    /// Those of them that a snapshot had.
    pub from_snapshot: u64,
    /// Those that are pushed anew.
    pub replayed: u64,
    /// Why the newest snapshot was not used, where it was not.
    pub passed_over: Option<PassedOver>,
    /// Where the journal stops making sense.
    pub damage: Option<Damage>,
}

/// A mapper as a snapshot has it, and what the journal has behind that.
pub struct Recalled {
    /// The mapper that took the keyframes before.
    pub mapper: Mapper,
    /// The keyframes to be pushed anew, in order, as [`Mapper::push_packed`] takes them.
    pub behind: Vec<Packed>,
    /// How it came back.
    pub restored: Restored,
}

impl Mapper {
    /// The mapper that took the keyframes of a journal, to the last bit where this build wrote it.
    ///
    /// From the newest snapshot that fits on they are pushed anew; without any, all of them: slower, and the same map.
    pub fn restore(config: &Config, journal: &[u8]) -> Result<(Self, Restored), Error> {
        let bytes: Bytes = Arc::new(journal.to_vec());
        let Recalled {
            mut mapper,
            behind,
            restored,
        } = Self::recall(config, Contents::of(&bytes)?, None);
        for keyframe in behind {
            mapper.push_packed(&keyframe);
        }
        Ok((mapper, restored))
    }

    /// The mapper of the newest snapshot that fits, for whoever pushes the rest in his own time. It takes some
    /// microseconds a keyframe, because it reads no more of them than their heads.
    ///
    /// `checkpoint`: a snapshot that stands elsewhere, as [`journal::JournalFile::checkpoint`] makes it. One that does
    /// not fit, be it that it is another journal's, is left out.
    pub fn recall(config: &Config, journal: Contents, checkpoint: Option<&[u8]>) -> Recalled {
        let (mapper, passed_over) = Self::of_checkpoint(config, &journal, checkpoint)
            .map_or_else(|| Self::newest(config, &journal), |mapper| (mapper, None));
        let mut restored = Restored {
            keyframes: journal.keyframes.len() as u64,
            from_snapshot: mapper.taken() as u64,
            replayed: 0,
            passed_over,
            damage: journal.damage,
        };
        let behind: Vec<Packed> = journal.keyframes.into_iter().skip(mapper.taken()).collect();
        restored.replayed = behind.len() as u64;
        Recalled {
            mapper,
            behind,
            restored,
        }
    }

    /// Pushes the payload of a keyframe's record. What is none is left out and counted like any other that cannot be the
    /// next one.
    pub fn push_packed(&mut self, payload: &[u8]) -> bool {
        let mut message = Message::default();
        if !journal::read_keyframe(payload, &mut message) {
            self.counters.keyframes_rejected += 1;
            return false;
        }
        self.push(message.as_ref())
    }

    /// How many keyframes it was given, be it that it left them out.
    pub fn taken(&self) -> usize {
        self.places.len() + self.counters.keyframes_rejected as usize
    }

    /// As of the newest snapshot that fits, or empty; and why it is not the newest.
    fn newest(config: &Config, journal: &Contents) -> (Self, Option<PassedOver>) {
        let (mut passed_over, mut tried) = (None, 0);
        let own = Origin::new(config);
        let snapshots: Vec<&[u8]> = journal
            .snapshots
            .iter()
            .map(|(payload, _)| &**payload)
            .collect();
        for (index, (payload, before)) in journal.snapshots.iter().enumerate().rev() {
            if snapshot::front(own, &mut &**payload).is_none() {
                passed_over.get_or_insert(PassedOver::Foreign);
                continue;
            }
            let keyframes = journal.keyframes.get(..*before).unwrap_or_default();
            let snapshots = snapshots.get(..=index).unwrap_or_default();
            if let Some(mapper) = Self::as_of(config, keyframes, snapshots) {
                return (mapper, passed_over);
            }
            passed_over.get_or_insert(PassedOver::Unfit);
            tried += 1;
            if tried == TRIED_MAX {
                break;
            }
        }
        (Self::new(config), passed_over)
    }

    /// As of a snapshot that stands behind all that the journal has; `None`, too, where a snapshot of the journal has
    /// more, because another process has gone on with it.
    fn of_checkpoint(
        config: &Config,
        journal: &Contents,
        checkpoint: Option<&[u8]>,
    ) -> Option<Self> {
        let (own, checkpoint) = (Origin::new(config), checkpoint?);
        let taken = |mut payload: &[u8]| snapshot::front(own, &mut payload);
        let snapshots = || journal.snapshots.iter().map(|(payload, _)| &**payload);
        let of_journal = snapshots().rev().find_map(taken);
        if taken(checkpoint)? < of_journal.unwrap_or(0) {
            return None;
        }
        let snapshots: Vec<&[u8]> = snapshots().chain([checkpoint]).collect();
        Self::as_of(config, &journal.keyframes, &snapshots)
    }

    /// The mapper as of the last of these snapshots; `None` where that does not fit those and the keyframes before it.
    fn as_of(config: &Config, keyframes: &[Packed], snapshots: &[&[u8]]) -> Option<Self> {
        let (taken, grown, memory) = remembered(config, snapshots)?;
        let mut mapper = Self::new(config);
        mapper.counters = memory.counters;
        let keyframes = keyframes.get(..usize::try_from(taken).ok()?)?;
        let odometry = mapper.recall_places(&memory.ids, keyframes, grown.keys)?;
        let rejected = taken.checked_sub(mapper.places.len() as u64)?;
        if rejected != memory.counters.keyframes_rejected || mapper.newest_ns() != memory.newest_ns
        {
            return None;
        }
        let poses: Vec<_> = memory.poses.iter().map(|pose| pose.0).collect();
        let candidates = grown.candidates;
        let mut ends = candidates.iter().flat_map(|c| [c.from, c.to]);
        if poses.len() != mapper.places.len() || ends.any(|place| place >= poses.len()) {
            return None;
        }
        let loops = memory.loops.iter().map(|l| l.restored(&candidates, &poses));
        let loops: Option<Vec<_>> = loops.collect();
        mapper.graph = PoseGraph::restore(poses, odometry, loops?, memory.next_loop).ok()?;
        let named = mapper.graph.loops().iter().zip(&memory.loops);
        mapper.loops = named.map(|(l, saved)| (l.id, saved.candidate)).collect();
        mapper.candidates = candidates;
        mapper.searched_m = memory.searched_m;
        mapper.joined_m = memory.joined_m;
        mapper.version = memory.version;
        Some(mapper)
    }

    /// Makes the places that have these numbers of keyframes, and gives their edges of odometry.
    fn recall_places(
        &mut self,
        ids: &[u64],
        keyframes: &[Packed],
        keys: Vec<RingKey>,
    ) -> Option<Vec<Edge>> {
        let mut wanted = ids.iter().scan(0_u64, |id, step| {
            *id = id.wrapping_add(*step);
            Some(*id)
        });
        let mut next = wanted.next();
        let mut keys = keys.into_iter();
        let mut odometry = Vec::new();
        let mut head = KeyframeHead::default();
        for packed in keyframes {
            if journal::read_head(packed, &mut head) && next == Some(head.id) && self.is_next(&head)
            {
                next = wanted.next();
                let place = Place::of(&head, packed.clone().into(), self.places.last());
                odometry.extend(self.step_to(&place));
                odometry.extend(self.tie_to(&place));
                self.places.push(place);
                self.submaps.push(&self.places);
                if self.config.loops.enabled {
                    self.search.recall(keys.next()?);
                }
            }
        }
        (next.is_none() && keys.next().is_none()).then_some(odometry)
    }
}

/// How many keyframes the last of these snapshots has taken, all that has grown by then, and what else it has.
fn remembered(config: &Config, snapshots: &[&[u8]]) -> Option<(u64, Grown, Memory)> {
    let own = Origin::new(config);
    let (mut taken, mut grown, mut rest): (_, _, &[u8]) = (None, Grown::default(), &[]);
    for payload in snapshots {
        rest = payload;
        taken = snapshot::front(own, &mut rest);
        if taken.is_some() {
            grown.take(snapshot::read(&mut rest)?)?;
        }
    }
    let taken = taken?;
    let memory: Memory = snapshot::read(&mut rest)?;
    if !rest.is_empty() || memory.fates.len() != grown.candidates.len() {
        return None;
    }
    for (candidate, fate) in grown.candidates.iter_mut().zip(&memory.fates) {
        candidate.fate = *fate;
    }
    Some((taken, grown, memory))
}
