//! The mapper: keyframes in, the global map out (paper, III-D).

mod close;
mod confirm;
mod join;
mod paint;
mod restore;
mod settle;
mod snapshot;

pub use restore::{PassedOver, Restored};

use crate::{
    Candidate, Fate, Place,
    graph::{Edge, Loop, LoopId, PoseGraph},
    grid::Grid,
    registration::Registrar,
    search::Search,
    submap::{Submaps, Trail},
    verify::position_sigma_m,
};
use nalgebra::Matrix3;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframeHead, MessageRef};

/// Least standard deviations of a step of odometry, m and rad: a covariance of nothing would make the graph stiff.
const STEP_SIGMA_MIN: [f64; 3] = [1e-3, 1e-3, 1e-4];

/// How well a keyframe is known from its submap's root: at least, and per metre of distance (m and rad). Simulated drives
/// show 0.015 m + 0.004 a metre and 0.002 rad + 0.0006 a metre where a submap grows, one room much less than that. The
/// graph takes ties and steps for independent though both are of the same odometry: sharper than this, it turns true
/// loops of the tunnel away.
const SUBMAP_SIGMA_M: [f64; 2] = [0.015, 0.003];
const SUBMAP_SIGMA_RAD: [f64; 2] = [0.003, 0.0003];

/// A keyframe is tied to its submap where its step is this sure in every direction, m: half of the keyframes in building
/// and yard.
const TIED_SIGMA_MAX_M: f64 = 0.02;

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

    /// Adds place and node; `false` where the keyframe cannot be one.
    fn add(&mut self, keyframe: MessageRef<'_, Keyframe>) -> bool {
        if !self.is_next(keyframe.head) {
            return false;
        }
        let place = Place::new(keyframe, self.places.last());
        let node = match self.step_to(&place) {
            Some(edge) => self.graph.append(edge),
            // A frame's own coordinates, until a loop joins it.
            None => self.graph.add_node(place.odom),
        };
        if node.is_ok() {
            if let Some(edge) = self.tie_to(&place) {
                // Both nodes are there and the numbers are good: the chain's edge was accepted.
                let _ = self.graph.add_odometry(edge);
            }
            self.places.push(place);
        }
        node.is_ok()
    }

    /// Lets the newest place into submaps and search.
    fn enter(&mut self) {
        self.submaps.push(&self.places);
        if let Some(place) = self.places.last()
            && self.config.loops.enabled
        {
            self.search.push(place);
        }
    }

    /// Whether a keyframe can follow those that are there; others would be left out.
    pub fn is_next(&self, head: &KeyframeHead) -> bool {
        // A clock that was set back opens a new frame of odometry.
        let rises = self.places.last().is_none_or(|before| {
            head.id > before.keyframe_id
                && (head.odom_frame_id > before.odom_frame_id
                    || head.odom_frame_id == before.odom_frame_id
                        && head.header.stamp_ns > before.stamp_ns)
        });
        rises && head.pose.iter().all(|value| value.is_finite())
    }

    /// Odometry's step to a place that comes next, where it is of the same frame.
    fn step_to(&self, place: &Place) -> Option<Edge> {
        let before = self.places.last()?;
        let to = self.places.len();
        let factor = self.config.loops.odometry_covariance_factor;
        (before.odom_frame_id == place.odom_frame_id).then(|| Edge {
            from: to - 1,
            to,
            measured: before.odom.between(&place.odom),
            information: step_information(&(place.step_covariance * factor)),
        })
    }

    /// Ties a place that comes next to the root of the submap that odometry registered it to: within a submap errors do
    /// not add up as those of its steps would.
    fn tie_to(&self, place: &Place) -> Option<Edge> {
        let to = self.places.len();
        let root = self
            .places
            .binary_search_by_key(&place.submap_root, |other| other.keyframe_id);
        let from = root.ok()?;
        let root = self.places.get(from)?;
        // The step before says that already, or another frame has nothing to say.
        if from + 1 >= to || root.odom_frame_id != place.odom_frame_id {
            return None;
        }
        // Along a bare wall the scan did not hold on to the submap: errors do add up there.
        if position_sigma_m(&place.step_covariance) > TIED_SIGMA_MAX_M {
            return None;
        }
        let measured = root.odom.between(&place.odom);
        let distance_m = measured.translation().norm();
        let sigma = |[least, per_m]: [f64; 2]| least + per_m * distance_m;
        let (position, yaw) = (sigma(SUBMAP_SIGMA_M), sigma(SUBMAP_SIGMA_RAD));
        let information = [position, position, yaw].map(|sigma| 1.0 / (sigma * sigma));
        Some(Edge {
            from,
            to,
            measured,
            information: Matrix3::from_diagonal(&information.into()),
        })
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

/// Information of a step from its covariance, with floors; not finite ones count as unknown.
fn step_information(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&STEP_SIGMA_MIN.map(|sigma| sigma * sigma).into());
    let symmetric = (covariance + covariance.transpose()) * 0.5 + floor;
    let information = symmetric.cholesky().map(|cholesky| cholesky.inverse());
    let information = information.filter(|i| i.iter().all(|value| value.is_finite()));
    information.map_or_else(Matrix3::identity, |i| (i + i.transpose()) * 0.5)
}
