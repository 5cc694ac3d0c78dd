//! The mapper that was, from its journal.

use super::journal::{self, Bytes, Contents, Damage, Error, Packed};
use super::snapshot::{Grown, Opened};
use crate::Mapper;
use crate::index::KeyframeIdx;
use crate::keyframe::{MapKeyframe, SavedKeyframes};
use crate::place_recognition::RingKey;
use crate::pose_graph::{Edge, SavedGraph};
use crate::verification::LoopStatus;
use randt_config::Config;
use randt_messages::{KeyframeHead, Message};
use randt_persist::{Persist, Reader};
use std::sync::Arc;

/// Own snapshots that are tried before all keyframes are pushed anew: one always fits, unless
/// something is badly wrong.
const TRIED_MAX: usize = 2;

/// Why a snapshot was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SnapshotRejection {
    /// Another configuration has made it, or a build whose snapshots have another form.
    Foreign,
    /// It does not fit the keyframes before it.
    Inconsistent,
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
    pub rejection: Option<SnapshotRejection>,
    /// Where the journal stops making sense.
    pub damage: Option<Damage>,
}

/// A mapper as a snapshot has it, and what the journal has behind that.
pub struct Recalled {
    /// The mapper that took the keyframes before.
    pub mapper: Mapper,
    /// The keyframes to be pushed anew, in order, as [`Mapper::push_packed`] takes them.
    pub to_replay: Vec<Packed>,
    /// How it came back.
    pub restored: Restored,
}

impl Mapper {
    /// The mapper that took the keyframes of a journal, to the last bit where this build wrote it.
    ///
    /// From the newest snapshot that fits on they are pushed anew; without any, all of them:
    /// slower, and the same map.
    pub fn restore(config: &Config, journal: &[u8]) -> Result<(Self, Restored), Error> {
        let bytes: Bytes = Arc::new(journal.to_vec());
        let mut recalled = Self::recall(config, Contents::read(&bytes)?, None);
        for keyframe in recalled.to_replay {
            recalled.mapper.push_packed(&keyframe);
        }
        Ok((recalled.mapper, recalled.restored))
    }

    /// The mapper of the newest snapshot that fits, for callers that push the rest in their own
    /// time. It takes some microseconds a keyframe, because it reads no more of them than their
    /// heads.
    ///
    /// `checkpoint`: a snapshot that stands elsewhere, as [`journal::JournalFile::checkpoint`]
    /// makes it. One that does not fit, for example another journal's, is left out.
    pub fn recall(config: &Config, journal: Contents, checkpoint: Option<&[u8]>) -> Recalled {
        let (mapper, rejection) = Self::from_checkpoint(config, &journal, checkpoint)
            .map_or_else(|| Self::newest(config, &journal), |mapper| (mapper, None));
        let (keyframes, taken) = (journal.keyframes.len(), mapper.taken());
        Recalled {
            mapper,
            to_replay: journal.keyframes.into_iter().skip(taken).collect(),
            restored: Restored {
                keyframes: keyframes as u64,
                from_snapshot: taken as u64,
                replayed: keyframes.saturating_sub(taken) as u64,
                rejection,
                damage: journal.damage,
            },
        }
    }

    /// Pushes the payload of a keyframe's record. What is none is left out and counted like any
    /// other that cannot be the next one.
    pub fn push_packed(&mut self, payload: &[u8]) -> bool {
        let mut message = Message::default();
        if !journal::read_keyframe(payload, &mut message) {
            self.keyframes.rejected += 1;
            return false;
        }
        let is_taken = self.push(message.as_ref());
        let newest = self.keyframes.newest().filter(|_| is_taken);
        if let Some((newest, attached)) = newest.zip(journal::read_attached(payload)) {
            self.known_ground.is_leaving(newest, attached);
        }
        is_taken
    }

    /// As of the newest snapshot that fits, or empty; and why it is not the newest.
    fn newest(config: &Config, journal: &Contents) -> (Self, Option<SnapshotRejection>) {
        let (mut rejection, mut tried) = (None, 0);
        let empty = Self::new(config);
        let snapshots: Vec<&[u8]> = journal.snapshots.iter().map(|(p, _)| &**p).collect();
        for (index, (payload, before)) in journal.snapshots.iter().enumerate().rev() {
            if Opened::new(empty.fingerprint, payload).is_err() {
                rejection.get_or_insert(SnapshotRejection::Foreign);
                continue;
            }
            let keyframes = journal.keyframes.get(..*before).unwrap_or_default();
            let snapshots = snapshots.get(..=index).unwrap_or_default();
            if let Some(mapper) = Self::from_snapshots(config, keyframes, snapshots) {
                return (mapper, rejection);
            }
            rejection.get_or_insert(SnapshotRejection::Inconsistent);
            tried += 1;
            if tried == TRIED_MAX {
                break;
            }
        }
        (empty, rejection)
    }

    /// As of a snapshot that stands behind all that the journal has; `None`, too, where a snapshot
    /// of the journal has more, because another process has gone on with it.
    fn from_checkpoint(
        config: &Config,
        journal: &Contents,
        checkpoint: Option<&[u8]>,
    ) -> Option<Self> {
        let (own, checkpoint) = (crate::mapper::fingerprint(config), checkpoint?);
        let taken = |payload| Opened::new(own, payload).ok().map(|opened| opened.taken);
        let snapshots = || journal.snapshots.iter().map(|(payload, _)| &**payload);
        if taken(checkpoint)? < snapshots().rev().find_map(taken).unwrap_or(0) {
            return None;
        }
        let snapshots: Vec<&[u8]> = snapshots().chain([checkpoint]).collect();
        Self::from_snapshots(config, &journal.keyframes, &snapshots)
    }

    /// The mapper as of the last of these snapshots; `None` where that does not fit those and the
    /// keyframes before it.
    fn from_snapshots(config: &Config, keyframes: &[Packed], snapshots: &[&[u8]]) -> Option<Self> {
        let mut mapper = Self::new(config);
        let (mut newest, mut grown) = (None, Grown::default());
        for payload in snapshots {
            newest = Opened::new(mapper.fingerprint, payload).ok();
            if let Some(opened) = &mut newest {
                opened.add_to(&mut grown)?;
            }
        }
        let Opened { taken, mut rest } = newest?;
        let keyframes = keyframes.get(..usize::try_from(taken).ok()?)?;
        mapper.restore_state(&mut rest, grown, keyframes)?;
        Some(mapper)
    }

    /// Restores the mapper's state in the order in which a snapshot has it.
    fn restore_state(
        &mut self,
        rest: &mut Reader<'_>,
        grown: Grown,
        taken: &[Packed],
    ) -> Option<()> {
        let Grown { mut closures, keys } = grown;
        let mut keyframes = SavedKeyframes::default();
        let mut statuses: Vec<LoopStatus> = Vec::new();
        let mut graph = SavedGraph::default();
        keyframes.restore(rest).ok()?;
        statuses.restore(rest).ok()?;
        graph.restore(rest).ok()?;
        self.recognition.restore(rest).ok()?;
        self.merger.restore(rest).ok()?;
        self.known_ground.restore(rest).ok()?;
        self.version.restore(rest).ok()?;
        rest.end().ok()?;
        if statuses.len() != closures.len() {
            return None;
        }
        for (closure, status) in closures.iter_mut().zip(statuses) {
            closure.status = status;
        }
        let mut forgotten = Vec::new();
        let odometry = self.recall_keyframes(keyframes.ids(), taken, keys, &mut forgotten)?;
        self.keyframes.restore(&keyframes, taken.len() as u64)?;
        if graph.poses.len() != self.keyframes.len() {
            return None;
        }
        self.graph.restore(graph, odometry, &closures)?;
        self.verification.closures = closures;
        self.graph.recall_visitors(&forgotten);
        let unneeded = self.known_ground.recall(&self.keyframes, &self.graph);
        self.forget(&unneeded);
        Some(())
    }

    /// Makes the keyframes that have these numbers, and gives their constraints of odometry. Lists
    /// those of which the journal has no more than their numbers.
    fn recall_keyframes(
        &mut self,
        mut ids: impl Iterator<Item = u64>,
        keyframes: &[Packed],
        keys: Vec<RingKey>,
        forgotten: &mut Vec<KeyframeIdx>,
    ) -> Option<Vec<Edge>> {
        let mut next = ids.next();
        let mut keys = keys.into_iter();
        let mut odometry = Vec::new();
        let mut head = KeyframeHead::default();
        for packed in keyframes {
            if journal::read_head(packed, &mut head) && next == Some(head.id) && self.is_next(&head)
            {
                next = ids.next();
                let observation = packed.clone().into();
                let keyframe = MapKeyframe::from_head(&head, observation, self.keyframes.last());
                odometry.extend(self.graph.odometry_constraints(&keyframe, &self.keyframes));
                self.keyframes.push(keyframe);
                if let Some(attached) = journal::read_attached(packed) {
                    let newest = self.keyframes.newest()?;
                    forgotten.push(newest);
                    self.known_ground.is_leaving(newest, attached);
                } else {
                    self.known_ground.stays();
                }
                self.verification.submaps.push(&self.keyframes);
                self.recognition.recall(&mut keys)?;
            }
        }
        (next.is_none() && keys.next().is_none()).then_some(odometry)
    }
}
