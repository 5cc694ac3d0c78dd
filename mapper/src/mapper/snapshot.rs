//! What cannot be made again from keyframes alone: where they came to stand, and what became of every candidate.
//!
//! Places, edges of odometry, submaps, descriptors and the grid follow from keyframes and poses. Of candidates only
//! their fate ever changes, and ring keys do not, so a snapshot has those that came after the one before it: a twentieth
//! of all. Keys are there though they follow from keyframes, because each search looks through all of them: a mapper
//! that comes back would have to unpack its whole journal.

use super::{Counters, Mapper, fingerprint};
use crate::{
    Candidate, Fate, RingKey,
    graph::{Loop, LoopId},
    plain,
};
use randt_config::Config;
use randt_geometry::Pose2;
use serde::{Deserialize, Serialize};

/// What a snapshot looks like: to be raised with every change of the structs below and of what they hold, which a test
/// notices. The build does not matter: another one's map is a map, and pushing thousands of keyframes anew takes
/// minutes in which a robot that was updated has none.
const FORM: u64 = 2;

/// What kind of snapshot it is; in front of the numbers, so that a foreign one is never read further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Origin {
    form: u64,
    config: u64,
}

/// How much the snapshots of a journal have of what only grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Known {
    candidates: usize,
    keys: usize,
}

/// What only grows, from what was known on; with the snapshots before it, all that there is.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct News {
    known: Known,
    candidates: Vec<Candidate>,
    keys: Vec<RingKey>,
}

/// What only grows, all of it.
#[derive(Debug, Default)]
pub(super) struct Grown {
    pub candidates: Vec<Candidate>,
    pub keys: Vec<RingKey>,
}

impl Grown {
    /// Takes the next snapshot's news; `None` where something between is missing.
    pub fn take(&mut self, news: News) -> Option<()> {
        let known = news.known;
        if known.candidates > self.candidates.len() || known.keys > self.keys.len() {
            return None;
        }
        self.candidates.truncate(known.candidates);
        self.candidates.extend(news.candidates);
        self.keys.truncate(known.keys);
        self.keys.extend(news.keys);
        Some(())
    }
}

/// The rest of the mapper's memory.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Memory {
    /// What each place's number is above the one before: it says which of the journal's keyframes the map has.
    pub ids: Vec<u64>,
    /// Of the newest place: numbers begin anew with every mission, stamps do not.
    pub newest_ns: i64,
    pub poses: Vec<SavedPose>,
    /// Of all candidates.
    pub fates: Vec<Fate>,
    pub loops: Vec<SavedLoop>,
    pub next_loop: u64,
    pub searched_m: f64,
    pub joined_m: f64,
    pub counters: Counters,
    pub version: u64,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SavedPose(#[serde(with = "plain::pose")] pub Pose2);

/// A loop of the graph, but for its edge, which its candidate has.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SavedLoop {
    id: u64,
    pub candidate: usize,
    on: bool,
    /// chi2 and weight where they are not what the poses say: after an optimisation without a result.
    odd: Option<(f64, f64)>,
}

impl SavedLoop {
    fn of(found: &Loop, candidate: usize, poses: &[Pose2]) -> Self {
        let bits = |l: &Loop| (l.chi2.to_bits(), l.weight.to_bits());
        let is_odd = bits(&found.weighed(poses)) != bits(found);
        Self {
            id: found.id.0,
            candidate,
            on: found.on,
            odd: is_odd.then_some((found.chi2, found.weight)),
        }
    }

    /// The loop as it was; `None` where its candidate or their places are not there.
    pub fn restored(&self, candidates: &[Candidate], poses: &[Pose2]) -> Option<Loop> {
        let found = Loop {
            id: LoopId(self.id),
            edge: candidates.get(self.candidate)?.edge(),
            chi2: 0.0,
            weight: 1.0,
            on: self.on,
        };
        if found.edge.from.max(found.edge.to) >= poses.len() {
            return None;
        }
        Some(match self.odd {
            Some((chi2, weight)) => Loop {
                chi2,
                weight,
                ..found
            },
            None => found.weighed(poses),
        })
    }
}

impl Origin {
    pub fn new(config: &Config) -> Self {
        Self {
            form: FORM,
            config: fingerprint(config),
        }
    }
}

/// Reads what stands in front of a snapshot: how many keyframes its mapper had taken; `None` where it is none of these.
pub(super) fn front(own: Origin, payload: &mut &[u8]) -> Option<u64> {
    let origin: Origin = read(payload)?;
    read(payload).filter(|_| origin == own)
}

/// Reads what stands in front of bytes; `None` where that is something else.
pub(super) fn read<'a, T: Deserialize<'a>>(bytes: &mut &'a [u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(bytes).ok()?;
    *bytes = rest;
    Some(value)
}

impl Mapper {
    /// What a journal knows of it that has a snapshot of now.
    pub fn known(&self) -> Known {
        Known {
            candidates: self.candidates.len(),
            keys: self.search.keys().len(),
        }
    }

    pub(super) fn newest_ns(&self) -> i64 {
        self.places.last().map_or(0, |place| place.stamp_ns)
    }

    /// Appends what [`Mapper::restore`] needs beside the keyframes and what the snapshots before it have.
    pub(crate) fn snapshot(&self, known: Known, out: &mut Vec<u8>) {
        let candidates = self.candidates.get(known.candidates..);
        let keys = self.search.keys().get(known.keys..);
        let news = News {
            known,
            candidates: candidates.unwrap_or_default().to_vec(),
            keys: keys.unwrap_or_default().to_vec(),
        };
        let ids = self.places.iter().map(|place| place.keyframe_id);
        let before = std::iter::once(0).chain(ids.clone());
        let loops = self.graph.loops().iter().zip(&self.loops);
        let memory = Memory {
            ids: ids.zip(before).map(|(id, before)| id - before).collect(),
            newest_ns: self.newest_ns(),
            poses: self.graph.poses().iter().copied().map(SavedPose).collect(),
            fates: self.candidates.iter().map(|c| c.fate).collect(),
            loops: loops
                .map(|(l, (_, candidate))| SavedLoop::of(l, *candidate, self.graph.poses()))
                .collect(),
            next_loop: self.graph.next_loop(),
            searched_m: self.searched_m,
            joined_m: self.joined_m,
            counters: self.counters,
            version: self.version,
        };
        let origin = Origin::new(&self.config);
        // Numbers into memory: nothing there can fail.
        if let Ok(bytes) = postcard::to_allocvec(&(origin, self.taken() as u64, news, memory)) {
            out.extend_from_slice(&bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ScanContext, Scores, search::Source};
    use nalgebra::Matrix3;
    use randt_config::Loops;

    /// Whoever changes what is saved raises `FORM` and writes the new sum here: an older snapshot would else be read as
    /// something that it is not.
    #[test]
    fn form_two_is_as_it_was() {
        let candidate = Candidate {
            from: 1,
            to: 300,
            source: Source::Appearance {
                distance: 0.25,
                yaw_rad: 1.5,
            },
            relative: Pose2::from_array([1.0, 2.0, 0.5]),
            information: Matrix3::identity(),
            scores: Scores {
                forward: Some(0.5),
                chi2: Some(2.0),
                ..Scores::default()
            },
            fate: Fate::Withdrawn,
        };
        let (_, key) = ScanContext::new(&[], &Loops::default());
        let news = News {
            known: Known {
                candidates: 7,
                keys: 9,
            },
            candidates: vec![candidate],
            keys: vec![key],
        };
        let saved = SavedLoop {
            id: 3,
            candidate: 0,
            on: true,
            odd: Some((1.0, 0.5)),
        };
        let memory = Memory {
            ids: vec![0, 1, 300],
            newest_ns: 1_700_000_000_000_000_000,
            poses: vec![SavedPose(candidate.relative)],
            fates: vec![Fate::Accepted, Fate::Withdrawn],
            loops: vec![saved],
            next_loop: 4,
            searched_m: 10.0,
            joined_m: 20.0,
            counters: Counters {
                keyframes_rejected: 1,
                solver_failures: 2,
            },
            version: 9,
        };
        let bytes = postcard::to_allocvec(&(FORM, 4_u64, news, memory)).unwrap();
        assert_eq!((bytes.len(), crc32fast::hash(&bytes)), (311, 0x755f_ddd3));
    }
}
