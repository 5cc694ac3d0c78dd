//! The mapper that was, from its journal.

use super::Mapper;
use super::snapshot::Memory;
use crate::{
    Place,
    graph::{Edge, PoseGraph},
    journal::{self, Damage, Error, Kind, Records},
};
use randt_config::Config;
use randt_messages::Message;

/// Own snapshots that are tried before all keyframes are pushed anew: one always fits, unless something is badly wrong.
const TRIED_MAX: usize = 2;

/// Why a snapshot was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassedOver {
    /// Another build or another configuration has made it.
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
    /// Those that were pushed anew.
    pub replayed: u64,
    /// Those that the map does not have: not to be read, or refused.
    pub left_out: u64,
    /// Why the newest snapshot was not used, where it was not.
    pub passed_over: Option<PassedOver>,
    /// Where the journal stops making sense.
    pub damage: Option<Damage>,
}

/// A snapshot where it stands.
struct Standing<'a> {
    payload: &'a [u8],
    /// Keyframes before it.
    keyframes: u64,
    /// The records behind it.
    behind: Records<'a>,
}

impl Mapper {
    /// The mapper that took the keyframes of a journal, to the last bit. From the newest snapshot that fits on they are
    /// pushed anew; without any, all of them: slower, and the same map.
    pub fn restore(config: &Config, journal: &[u8]) -> Result<(Self, Restored), Error> {
        let (_, records) = journal::records(journal)?;
        let mut restored = Restored::default();
        let mut tried = 0;
        for snapshot in snapshots(records.clone()) {
            let memory = Memory::read(snapshot.payload, config);
            let recalled = memory.and_then(|memory| {
                tried += 1;
                let keyframes = records.clone();
                Self::recall(config, memory, keyframes, snapshot.keyframes).ok_or(PassedOver::Unfit)
            });
            match recalled {
                Ok(mut mapper) => {
                    restored.from_snapshot = snapshot.keyframes;
                    mapper.replay(snapshot.behind, &mut restored);
                    return Ok((mapper, restored));
                }
                Err(why) => restored.passed_over = restored.passed_over.or(Some(why)),
            }
            if tried == TRIED_MAX {
                break;
            }
        }
        let mut mapper = Self::new(config);
        mapper.replay(records, &mut restored);
        Ok((mapper, restored))
    }

    /// The mapper with this memory and the keyframes before it; `None` where they do not fit.
    fn recall(
        config: &Config,
        memory: Memory,
        records: Records<'_>,
        keyframes: u64,
    ) -> Option<Self> {
        let mut mapper = Self::new(config);
        let odometry = mapper.recall_places(&memory.ids, records, keyframes)?;
        let places = mapper.places.len();
        let mut ends = memory.candidates.iter().flat_map(|c| [c.from, c.to]);
        if memory.poses.len() != places || ends.any(|place| place >= places) {
            return None;
        }
        let poses = memory.poses.iter().map(|pose| pose.0).collect();
        let loops = memory.loops.iter();
        let loops: Option<Vec<_>> = loops.map(|l| l.restored(&memory.candidates)).collect();
        mapper.graph = PoseGraph::restore(poses, odometry, loops?, memory.next_loop).ok()?;
        let named = mapper.graph.loops().iter().zip(&memory.loops);
        mapper.loops = named.map(|(l, saved)| (l.id, saved.candidate)).collect();
        mapper.candidates = memory.candidates;
        mapper.searched_m = memory.searched_m;
        mapper.joined_m = memory.joined_m;
        mapper.counters = memory.counters;
        mapper.version = memory.version;
        Some(mapper)
    }

    /// Makes the places that have these numbers of the first keyframes, and gives their edges of odometry.
    fn recall_places(
        &mut self,
        ids: &[u64],
        records: Records<'_>,
        keyframes: u64,
    ) -> Option<Vec<Edge>> {
        let mut wanted = ids.iter().scan(0_u64, |id, step| {
            *id = id.wrapping_add(*step);
            Some(*id)
        });
        let mut next = wanted.next();
        let mut odometry = Vec::new();
        let mut message = Message::default();
        let keyframes = usize::try_from(keyframes).ok()?;
        for record in records.of(Kind::Keyframe).take(keyframes) {
            if journal::read_keyframe(record.payload, &mut message)
                && next == Some(message.head.id)
                && self.is_next(&message.head)
            {
                next = wanted.next();
                let place = Place::new(message.as_ref(), self.places.last());
                odometry.extend(self.step_to(&place));
                odometry.extend(self.tie_to(&place));
                self.places.push(place);
                self.enter();
            }
        }
        next.is_none().then_some(odometry)
    }

    /// Pushes the keyframes that are left.
    fn replay(&mut self, mut records: Records<'_>, restored: &mut Restored) {
        let mut message = Message::default();
        for record in records.by_ref().filter(|r| r.kind == Kind::Keyframe) {
            restored.replayed += 1;
            if journal::read_keyframe(record.payload, &mut message) {
                self.push(message.as_ref());
            }
        }
        restored.keyframes = restored.from_snapshot + restored.replayed;
        restored.left_out = restored.keyframes - self.places.len() as u64;
        restored.damage = records.damage().cloned();
    }
}

/// The snapshots, the newest first.
fn snapshots<'a>(mut records: Records<'a>) -> impl Iterator<Item = Standing<'a>> {
    let mut found = Vec::new();
    let mut keyframes = 0;
    while let Some(record) = records.next() {
        match record.kind {
            Kind::Keyframe => keyframes += 1,
            Kind::Snapshot => found.push(Standing {
                payload: record.payload,
                keyframes,
                behind: records.clone(),
            }),
        }
    }
    found.into_iter().rev()
}
