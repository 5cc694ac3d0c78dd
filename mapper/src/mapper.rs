//! The mapper: keyframes in, the global map out (paper, III-D).

mod close;
mod confirm;
mod join;
mod node;
mod paint;
mod restore;
mod settle;
mod snapshot;

pub use restore::{PassedOver, Recalled, Restored};
pub use snapshot::Known;

use crate::{
    Candidate, Fate, Place,
    graph::{Loop, LoopId, PoseGraph},
    grid::Grid,
    registration::Registrar,
    search::Search,
    submap::{Submaps, Trail},
};
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, MessageRef};

/// The sections of the configuration that the map is computed by.
pub const SECTIONS: [&str; 8] = [
    "filter", "grid", "keyframe", "loops", "ndt", "odometry", "sensor", "submap",
];

/// A number that differs where any value differs that the map is computed by.
pub(crate) fn fingerprint(config: &Config) -> u64 {
    config.fingerprint_of(|section| SECTIONS.contains(&section))
}

/// Loops are searched for every so many keyframe distances of path.
const SEARCH_KEYFRAMES: f64 = 2.0;

/// What was dropped or failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Keyframes left out: numbers, frames or stamps that do not rise, values that are not finite.
    pub keyframes_rejected: u64,
    /// Optimisations without a result; the estimate stayed where it was.
    pub solver_failures: u64,
}

/// The global map.
pub struct Mapper {
    config: Config,
    places: Vec<Place>,
    graph: PoseGraph,
    submaps: Submaps,
    search: Search,
    trail: Trail,
    registrar: Registrar,
    grid: Grid,
    candidates: Vec<Candidate>,
    /// Loops of the graph: name there, index of the candidate.
    loops: Vec<(LoopId, usize)>,
    /// Path at which loops were last searched for, and at which a part was last tried to be joined, m.
    searched_m: f64,
    joined_m: f64,
    counters: Counters,
    /// Rises with every change of the map.
    version: u64,
}

impl Mapper {
    /// Empty.
    pub fn new(config: &Config) -> Self {
        Self {
            places: Vec::new(),
            graph: PoseGraph::default(),
            submaps: Submaps::new(config),
            search: Search::new(config),
            trail: Trail::new(config),
            registrar: Registrar::new(config),
            grid: Grid::new(&config.grid),
            candidates: Vec::new(),
            loops: Vec::new(),
            searched_m: f64::NEG_INFINITY,
            joined_m: f64::NEG_INFINITY,
            counters: Counters::default(),
            version: 0,
            config: config.clone(),
        }
    }

    /// Takes the next keyframe: it enters graph and submaps, and where it closes loops the map follows. `false` where it
    /// cannot be the next one: it is counted, and the map stays as it was.
    ///
    /// What is kept from one keyframe to the next is what [`Mapper::restore`] brings back, no more: the graph's
    /// equations are made anew for every new node.
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        if !self.add(keyframe) {
            self.counters.keyframes_rejected += 1;
            return false;
        }
        self.version += 1;
        self.enter();
        let Some(place) = self.places.last() else {
            return true;
        };
        // Neither turning on the spot nor a step shows anything new.
        let since_m = place.path_m - self.searched_m;
        if self.config.loops.enabled
            && since_m >= SEARCH_KEYFRAMES * self.config.keyframe.distance_m
        {
            self.searched_m = place.path_m;
            self.close_loops();
            self.join();
        }
        true
    }

    /// The drive is over: the map is judged as a whole once more.
    pub fn finish(&mut self) {
        self.version += 1;
        self.recheck();
        self.update_grid();
    }

    /// All keyframes, in order.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Where they stand; poses of different parts have nothing in common.
    pub fn poses(&self) -> &[Pose2] {
        self.graph.poses()
    }

    /// The part of the map that a keyframe belongs to, named by the part's first keyframe.
    pub fn part_of(&self, place: usize) -> usize {
        self.graph.component_of(place).unwrap_or(place)
    }

    /// The part with most keyframes, the older one of equals.
    pub fn largest_part(&self) -> usize {
        let mut sizes = vec![0_usize; self.places.len()];
        for place in 0..self.places.len() {
            if let Some(size) = sizes.get_mut(self.part_of(place)) {
                *size += 1;
            }
        }
        let largest = sizes.iter().copied().max().unwrap_or(0);
        sizes.iter().position(|size| *size == largest).unwrap_or(0)
    }

    /// How many parts there are that nothing joins.
    pub fn parts(&self) -> usize {
        let places = 0..self.places.len();
        places
            .filter(|place| self.part_of(*place) == *place)
            .count()
    }

    /// Path over all keyframes, m.
    pub fn path_m(&self) -> f64 {
        self.places.last().map_or(0.0, |place| place.path_m)
    }

    /// Loops as the graph has them, in order of their names.
    pub fn graph_loops(&self) -> &[Loop] {
        self.graph.loops()
    }

    /// All candidates so far, in order.
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Loops in the graph.
    pub fn loops(&self) -> impl Iterator<Item = &Candidate> {
        self.candidates
            .iter()
            .filter(|candidate| candidate.fate == Fate::Accepted)
    }

    /// Rises with every change of the map; after a restart it goes on.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// What was dropped or failed.
    pub fn counters(&self) -> Counters {
        self.counters
    }
}
