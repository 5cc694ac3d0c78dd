//! The mapper that was, from its journal.

use super::Mapper;
use super::snapshot::{self, Memory, News, Origin};
use crate::{
    Candidate, Place,
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
    /// The mapper that took the keyframes of a journal, to the last bit where this build wrote it. From the newest snapshot that fits on they are
    /// pushed anew; without any, all of them: slower, and the same map.
    pub fn restore(config: &Config, journal: &[u8]) -> Result<(Self, Restored), Error> {
        let (_, records) = journal::records(journal)?;
        let mut restored = Restored::default();
        let snapshots = snapshots(records.clone());
        let mut tried = 0;
        for (index, snapshot) in snapshots.iter().enumerate().rev() {
            let mut payload = snapshot.payload;
            if snapshot::read(&mut payload) != Some(Origin::new(config)) {
                restored.passed_over.get_or_insert(PassedOver::Foreign);
                continue;
            }
            let until = snapshots.get(..=index).unwrap_or_default();
            if let Some(mut mapper) = Self::recall(config, records.clone(), until) {
                restored.from_snapshot = snapshot.keyframes;
                mapper.replay(snapshot.behind.clone(), &mut restored);
                return Ok((mapper, restored));
            }
            restored.passed_over.get_or_insert(PassedOver::Unfit);
            tried += 1;
            if tried == TRIED_MAX {
                break;
            }
        }
        let mut mapper = Self::new(config);
        mapper.replay(records, &mut restored);
        Ok((mapper, restored))
    }

    /// The mapper as of the last of these snapshots; `None` where it does not fit those and the keyframes before it.
    fn recall(config: &Config, records: Records<'_>, snapshots: &[Standing<'_>]) -> Option<Self> {
        let (candidates, memory) = remembered(config, snapshots)?;
        let mut mapper = Self::new(config);
        let odometry = mapper.recall_places(&memory.ids, records, snapshots.last()?.keyframes)?;
        let poses: Vec<_> = memory.poses.iter().map(|pose| pose.0).collect();
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

/// All candidates as of the last of these snapshots, and what else it has.
fn remembered(config: &Config, snapshots: &[Standing<'_>]) -> Option<(Vec<Candidate>, Memory)> {
    let own = Origin::new(config);
    let (mut candidates, mut rest): (Vec<Candidate>, &[u8]) = Default::default();
    for snapshot in snapshots {
        rest = snapshot.payload;
        if snapshot::read(&mut rest) != Some(own) {
            continue;
        }
        let news: News = snapshot::read(&mut rest)?;
        if news.first > candidates.len() {
            return None;
        }
        candidates.truncate(news.first);
        candidates.extend(news.candidates);
    }
    let memory: Memory = snapshot::read(&mut rest)?;
    if !rest.is_empty() || memory.fates.len() != candidates.len() {
        return None;
    }
    for (candidate, fate) in candidates.iter_mut().zip(&memory.fates) {
        candidate.fate = *fate;
    }
    Some((candidates, memory))
}

/// The snapshots of a journal.
fn snapshots(mut records: Records<'_>) -> Vec<Standing<'_>> {
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
    found
}
