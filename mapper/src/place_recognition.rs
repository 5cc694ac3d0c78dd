//! Which old keyframes the newest one may have come back to: by what it looks like, and by where
//! the estimate has it.
//!
//! Responsible for candidates and for when they are searched for. Not responsible for whether they
//! are loops.

mod scan_context;
mod search;

pub use scan_context::{Likeness, RingKey, ScanContext};

use crate::index::KeyframeIdx;
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::pose_graph::KeyframeGraph;
use randt_config::{Config, Loops};
use randt_persist::{persist, persist_enum};
use std::cell::OnceCell;

/// Loops are searched for at every this many keyframe distances of path.
const SEARCH_KEYFRAMES: f64 = 2.0;
/// Keyframes are near within this many standard deviations of the estimate, at least and at most
/// this many metres.
const NEAR_DEVIATIONS: f64 = 3.0;
const NEAR_MIN_M: f64 = 2.0;
pub(crate) const NEAR_MAX_M: f64 = 8.0;
/// The estimate counts as no sharper than this for what looks alike, m.
const SIGMA_MIN_M: f64 = 0.1;

/// Why an old keyframe is a candidate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CandidateOrigin {
    /// The keyframes look alike under this turn.
    Appearance {
        /// ScanContext distance, with odometry's part.
        distance: f64,
        /// Heading of the newest keyframe in the frame of the old one, rad.
        yaw_rad: f64,
    },
    /// The estimate has the robot there again.
    #[default]
    Proximity,
}

persist_enum!(CandidateOrigin {
    Appearance { distance, yaw_rad },
    Proximity,
});

impl CandidateOrigin {
    /// Its name in the report.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Appearance { .. } => "appearance",
            Self::Proximity => "proximity",
        }
    }
}

/// An old keyframe that the newest one may be at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopCandidate {
    /// The old keyframe.
    pub keyframe: KeyframeIdx,
    /// Why.
    pub origin: CandidateOrigin,
}

/// The search for loop candidates, at every few metres of path.
pub struct PlaceRecognition {
    config: Loops,
    /// Path at which loops were last searched for, m.
    searched_m: f64,
    every_m: f64,
    /// Distance between keyframes, m.
    step_m: f64,
    apart_m: f64,
    /// The ring keys of all keyframes.
    pub(crate) keys: Vec<RingKey>,
    /// Their descriptors; a recalled keyframe has its from its first comparison on.
    contexts: Vec<OnceCell<ScanContext>>,
}
// The keys are in a snapshot's increment.
persist!(PlaceRecognition { searched_m } kept { config, every_m, step_m, apart_m, keys, contexts });

impl PlaceRecognition {
    /// Nothing seen yet.
    pub fn new(config: &Config) -> Self {
        Self {
            config: config.loops.clone(),
            searched_m: f64::NEG_INFINITY,
            every_m: SEARCH_KEYFRAMES * config.keyframe.distance_m,
            step_m: config.keyframe.distance_m,
            apart_m: config.map_reach_m(),
            keys: Vec::new(),
            contexts: Vec::new(),
        }
    }

    /// Takes the newest keyframe.
    pub fn push(&mut self, keyframe: &MapKeyframe) {
        if self.config.enabled {
            let (context, key) = ScanContext::new(&keyframe.observation.points, &self.config);
            self.keys.push(key);
            self.contexts.push(context.into());
        }
    }

    /// Takes the newest keyframe of a map that comes back; `None` where its key is not there.
    pub(crate) fn recall(&mut self, keys: &mut impl Iterator<Item = RingKey>) -> Option<()> {
        if self.config.enabled {
            self.keys.push(keys.next()?);
            self.contexts.push(OnceCell::new());
        }
        Some(())
    }

    /// Forgets what a keyframe that has left the graph looks like: no search asks for it.
    pub(crate) fn forget(&mut self, keyframe: KeyframeIdx) {
        let (key, context) = (
            self.keys.get_mut(keyframe.0),
            self.contexts.get_mut(keyframe.0),
        );
        if let Some((key, context)) = key.zip(context) {
            (*key, *context) = (RingKey::default(), OnceCell::new());
        }
    }

    /// Whether a search is due at this path; it counts as done. Neither turning on the spot nor a
    /// step shows anything new.
    pub(crate) fn is_due(&mut self, path_m: f64) -> bool {
        let is_due = self.config.enabled && path_m - self.searched_m >= self.every_m;
        if is_due {
            self.searched_m = path_m;
        }
        is_due
    }

    /// Candidates of both origins for the newest keyframe.
    pub(crate) fn candidates(
        &self,
        keyframes: &KeyframeStore,
        graph: &mut KeyframeGraph,
    ) -> Vec<LoopCandidate> {
        let Some(newest) = keyframes.newest() else {
            return Vec::new();
        };
        if !self.config.verify {
            let mut candidates = self.by_appearance(keyframes, |_| true, |_| None);
            candidates.truncate(1);
            return candidates;
        }
        // One covariance for all: that of the keyframe against the start of its component.
        let component = graph.component_of(newest);
        let prior = graph.prior(component.first_keyframe(), newest);
        let sigma_m = prior.map_or(f64::INFINITY, |prior| prior.sigma_m());
        let away_m = |old: KeyframeIdx| {
            let (here, there) = (graph.pose(newest)?, graph.pose(old)?);
            let is_same = graph.component_of(old) == component;
            (is_same && graph.is_unknown(old))
                .then(|| (here.translation() - there.translation()).norm())
        };
        let is_node = |old: KeyframeIdx| graph.is_unknown(old);
        let mut candidates = self.by_appearance(keyframes, is_node, |old| {
            let beyond_m = (away_m(old)? - NEAR_MIN_M).max(0.0);
            Some(beyond_m / sigma_m.max(SIGMA_MIN_M))
        });
        let radius_m = (NEAR_DEVIATIONS * sigma_m).clamp(NEAR_MIN_M, NEAR_MAX_M);
        candidates.extend(self.by_proximity(keyframes, radius_m, away_m));
        candidates
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_is_due_at_every_second_keyframe_distance() {
        let config = Config::default();
        let mut recognition = PlaceRecognition::new(&config);
        let step_m = config.keyframe.distance_m;
        let due: Vec<bool> = [0.0, 1.0, 2.0, 3.0, 5.0, 5.0]
            .map(|steps| recognition.is_due(steps * step_m))
            .into();
        assert_eq!(due, [true, false, true, false, true, false]);
    }
}
