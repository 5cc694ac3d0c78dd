//! What cannot be made again from keyframes alone: where they came to stand, and what became of every candidate.
//!
//! Places, edges of odometry, submaps, descriptors and the grid follow from keyframes and poses.

use super::{Counters, Mapper, PassedOver};
use crate::{
    Candidate,
    graph::{Loop, LoopId},
    journal::fingerprint,
    plain,
};
use randt_config::Config;
use randt_geometry::Pose2;
use serde::{Deserialize, Serialize};

/// The code whose snapshot this is: another one's numbers may differ in their last bits.
const CODE: u64 = match u64::from_str_radix(env!("RANDT_CODE"), 16) {
    Ok(code) => code,
    Err(_) => 0,
};

/// Whose snapshot it is; in front of the numbers, so that a foreign one is never read further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Origin {
    code: u64,
    config: u64,
}

/// The mapper's memory.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Memory {
    /// What each place's number is above the one before: it says which of the journal's keyframes the map has.
    pub ids: Vec<u64>,
    pub poses: Vec<SavedPose>,
    pub candidates: Vec<Candidate>,
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
    chi2: f64,
    weight: f64,
    on: bool,
}

impl SavedLoop {
    /// The loop as it was; `None` where it has no candidate.
    pub fn restored(&self, candidates: &[Candidate]) -> Option<Loop> {
        Some(Loop {
            id: LoopId(self.id),
            edge: candidates.get(self.candidate)?.edge(),
            chi2: self.chi2,
            weight: self.weight,
            on: self.on,
        })
    }
}

impl Origin {
    fn new(config: &Config) -> Self {
        Self {
            code: CODE,
            config: fingerprint(config),
        }
    }
}

impl Memory {
    /// What a snapshot holds, if it was made by this code under this configuration.
    pub fn read(snapshot: &[u8], config: &Config) -> Result<Self, PassedOver> {
        let (origin, bytes) =
            postcard::take_from_bytes::<Origin>(snapshot).map_err(|_| PassedOver::Unfit)?;
        if origin != Origin::new(config) {
            return Err(PassedOver::Foreign);
        }
        match postcard::take_from_bytes(bytes) {
            Ok((memory, [])) => Ok(memory),
            _ => Err(PassedOver::Unfit),
        }
    }
}

impl Mapper {
    /// Appends what [`Mapper::restore`] needs beside the keyframes.
    pub(crate) fn snapshot(&self, out: &mut Vec<u8>) {
        let before = std::iter::once(0).chain(self.places.iter().map(|place| place.keyframe_id));
        let pairs = self.places.iter().zip(before);
        let loops = self.graph.loops().iter().zip(&self.loops);
        let memory = Memory {
            ids: pairs
                .map(|(place, before)| place.keyframe_id - before)
                .collect(),
            poses: self.graph.poses().iter().copied().map(SavedPose).collect(),
            candidates: self.candidates.clone(),
            loops: loops
                .map(|(l, (_, candidate))| SavedLoop {
                    id: l.id.0,
                    candidate: *candidate,
                    chi2: l.chi2,
                    weight: l.weight,
                    on: l.on,
                })
                .collect(),
            next_loop: self.graph.next_loop(),
            searched_m: self.searched_m,
            joined_m: self.joined_m,
            counters: self.counters,
            version: self.version,
        };
        let origin = Origin::new(&self.config);
        // Numbers into memory: nothing there can fail.
        if let Ok(bytes) = postcard::to_allocvec(&(origin, memory)) {
            out.extend_from_slice(&bytes);
        }
    }
}
