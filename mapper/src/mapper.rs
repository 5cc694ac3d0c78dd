//! The mapper: keyframes in, the global map out (paper, III-D).

use crate::index::{ComponentIdx, KeyframeIdx};
use crate::journal::AttachedPose;
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::known_ground::KnownGround;
use crate::occupancy::{Grid, GridKeyframe, GridUpdate};
use crate::place_recognition::PlaceRecognition;
use crate::pose_graph::{KeyframeGraph, Loop, Marginals};
use crate::verification::{ComponentMerger, LoopClosure, LoopStatus, LoopVerification};
use nalgebra::Matrix3;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframeHead, MessageRef};

/// The sections of the configuration that the map is computed by.
pub const SECTIONS: [&str; 8] = [
    "filter", "grid", "keyframe", "loops", "ndt", "odometry", "sensor", "submap",
];

/// A number that differs where any value differs that the map is computed by.
pub(crate) fn fingerprint(config: &Config) -> u64 {
    config.fingerprint_of(|section| SECTIONS.contains(&section))
}

/// What was dropped or failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Keyframes left out: numbers, frames or stamps that do not rise, values that are not finite.
    pub keyframes_rejected: u64,
    /// Optimisations without a result; the estimate stayed where it was.
    pub solver_failures: u64,
    /// How often the graph's equations were factorised since the mapper began or came back.
    pub factorisations: u64,
}

/// The global map.
pub struct Mapper {
    /// Of the configuration that the map is computed by.
    pub(crate) fingerprint: u64,
    pub(crate) keyframes: KeyframeStore,
    pub(crate) recognition: PlaceRecognition,
    pub(crate) verification: LoopVerification,
    pub(crate) merger: ComponentMerger,
    pub(crate) known_ground: KnownGround,
    pub(crate) graph: KeyframeGraph,
    grid: Grid,
    /// Rises with every change of the map.
    pub(crate) version: u64,
}

impl Mapper {
    /// Empty.
    pub fn new(config: &Config) -> Self {
        Self {
            fingerprint: fingerprint(config),
            keyframes: KeyframeStore::default(),
            recognition: PlaceRecognition::new(config),
            verification: LoopVerification::new(config),
            merger: ComponentMerger::new(config),
            known_ground: KnownGround::new(config),
            graph: KeyframeGraph::new(config),
            grid: Grid::new(&config.grid),
            version: 0,
        }
    }

    /// Takes the next keyframe: it enters graph and submaps, and where it closes loops the map
    /// follows. `false` where it cannot be the next one: it is counted, and the map stays as it
    /// was.
    ///
    /// What is kept from one keyframe to the next is what [`Mapper::restore`] brings back, no
    /// more: the graph's equations are made anew for every new node.
    pub fn push(&mut self, message: MessageRef<'_, Keyframe>) -> bool {
        let keyframe = MapKeyframe::new(message, self.keyframes.last());
        if !self.is_next(message.head) || !self.graph.append(&keyframe, &self.keyframes) {
            self.keyframes.rejected += 1;
            return false;
        }
        self.version += 1;
        self.recognition.push(&keyframe);
        self.keyframes.push(keyframe);
        self.verification.submaps.push(&self.keyframes);
        if self.recognition.is_due(self.path_m()) {
            self.close_loops();
        }
        let verification = &mut self.verification;
        let unneeded = (self.known_ground).thin(&self.keyframes, verification, &mut self.graph);
        self.forget(&unneeded);
        true
    }

    /// Forgets what keyframes that have left the graph saw; the grid no longer shows it.
    pub(crate) fn forget(&mut self, unneeded: &[KeyframeIdx]) {
        let (keyframes, poses) = (&self.keyframes, self.graph.poses());
        let observed = |keyframe: &KeyframeIdx| {
            let (keyframe, map_from_base) = keyframes.get(keyframe.0).zip(poses.get(keyframe.0))?;
            Some(GridKeyframe {
                id: keyframe.keyframe_id,
                map_from_base: *map_from_base,
                observation: &keyframe.observation,
            })
        };
        let observed: Vec<GridKeyframe<'_>> = unneeded.iter().filter_map(observed).collect();
        self.grid.remove(&observed);
        for keyframe in unneeded {
            self.keyframes.forget(*keyframe);
            self.recognition.forget(*keyframe);
            self.verification.submaps.forget(*keyframe);
        }
    }

    /// Searches for loops of the newest keyframe, takes those that hold, and merges components
    /// that prove to be one.
    fn close_loops(&mut self) {
        let (keyframes, graph) = (&self.keyframes, &mut self.graph);
        let candidates = self.recognition.candidates(keyframes, graph);
        self.verification.verify(&candidates, keyframes, graph);
        self.merger.merge(keyframes, &mut self.verification, graph);
    }

    /// The drive is over: the map is judged as a whole once more.
    pub fn finish(&mut self) {
        self.version += 1;
        let pruned = self.graph.recheck();
        self.verification.withdraw(&pruned);
        self.update_grid();
    }

    /// Whether a keyframe can follow those that are there; others are left out.
    pub fn is_next(&self, head: &KeyframeHead) -> bool {
        self.keyframes.is_next(head)
    }

    /// How many keyframes it was given, those left out included.
    pub fn taken(&self) -> usize {
        self.keyframes.taken()
    }

    /// All keyframes, in order.
    pub fn keyframes(&self) -> &[MapKeyframe] {
        &self.keyframes
    }

    /// Where they are in the map; poses of different components have nothing in common.
    pub fn poses(&self) -> &[Pose2] {
        self.graph.poses()
    }

    /// How well the keyframes that are nodes of the graph are known from each other; `None` where
    /// its equations have no solution.
    pub fn marginals(&self) -> Option<Marginals<'_>> {
        self.graph.marginals()
    }

    /// Whether a keyframe is a node of the graph; on known ground it stands on one.
    pub fn is_node(&self, keyframe: KeyframeIdx) -> bool {
        self.graph.is_unknown(keyframe)
    }

    /// Where a node of the graph is seen from an older one, and the covariance of that (x, y,
    /// yaw), in the frame of the newer one; m^2, m rad, rad^2.
    pub fn relative(
        &mut self,
        older: KeyframeIdx,
        newer: KeyframeIdx,
    ) -> Option<(Pose2, Matrix3<f64>)> {
        let prior = self.graph.prior(older, newer)?;
        Some((prior.older_from_newer, prior.covariance))
    }

    /// Whether the map still has what a keyframe saw.
    pub fn remembers(&self, keyframe: KeyframeIdx) -> bool {
        self.is_node(keyframe) || self.known_ground.remembers(keyframe)
    }

    /// The keyframes that have left the graph and are forgotten, with where they stand, rising.
    pub(crate) fn forgotten(&self) -> impl Iterator<Item = (u64, AttachedPose)> {
        let keyframes = self.keyframes.iter().enumerate();
        keyframes.filter_map(|(index, keyframe)| {
            let attachment = self.graph.attachment(KeyframeIdx(index))?;
            let to = self.keyframes.get(attachment.to.0)?.keyframe_id;
            let attached = AttachedPose {
                to,
                to_from_base: attachment.pose.to_array(),
            };
            let is_forgotten = !self.known_ground.remembers(KeyframeIdx(index));
            is_forgotten.then_some((keyframe.keyframe_id, attached))
        })
    }

    /// The component of the map that a keyframe belongs to.
    pub fn component_of(&self, keyframe: KeyframeIdx) -> ComponentIdx {
        self.graph.component_of(keyframe)
    }

    /// The component with most keyframes, the older one of equals.
    pub fn largest_component(&self) -> ComponentIdx {
        self.graph.largest_component()
    }

    /// How many components there are that no loop connects.
    pub fn components(&self) -> usize {
        self.graph.components()
    }

    /// Path over all keyframes, m.
    pub fn path_m(&self) -> f64 {
        self.keyframes.path_m()
    }

    /// Loops as the graph has them, in order of their names.
    pub fn graph_loops(&self) -> &[Loop] {
        self.graph.loops()
    }

    /// All candidates that were registered so far, in order.
    pub fn closures(&self) -> &[LoopClosure] {
        &self.verification.closures
    }

    /// Closures whose loops are in the graph.
    pub fn accepted(&self) -> impl Iterator<Item = &LoopClosure> {
        let closures = self.closures().iter();
        closures.filter(|closure| closure.status == LoopStatus::Accepted)
    }

    /// Closures of keyframes that show one place: loops of the graph, and those that confirm it.
    pub fn found(&self) -> impl Iterator<Item = &LoopClosure> {
        self.closures().iter().filter(|it| it.status.is_loop())
    }

    /// Brings the occupancy grid of the largest component up to the keyframes and where they are
    /// now. Not part of every step: whichever stage needs the grid decides how often.
    pub fn update_grid(&mut self) -> GridUpdate {
        self.update_grid_by(usize::MAX)
    }

    /// The same with about this many keyframes painted; more may be left.
    pub fn update_grid_by(&mut self, paintings_max: usize) -> GridUpdate {
        self.grid
            .follow(&self.keyframes, &self.graph, paintings_max)
    }

    /// The grid as of the last [`Mapper::update_grid`].
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Rises with every change of the map; after a restart it goes on.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// What was dropped or failed.
    pub fn counters(&self) -> Counters {
        Counters {
            keyframes_rejected: self.keyframes.rejected,
            solver_failures: self.graph.failures,
            factorisations: self.graph.factorisations(),
        }
    }
}
