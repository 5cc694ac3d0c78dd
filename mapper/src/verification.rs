//! From candidates to loop closures: registration against the old submap, gates, agreement, and
//! the graph.
//!
//! Responsible for which loops bend the map and for what became of every other one. Not
//! responsible for finding candidates, nor for the estimate.

mod closure;
mod confirm;
mod divergence;
mod gates;
mod merge;
mod profile;
mod registration;
mod submap;
mod way;

pub use closure::{LoopClosure, LoopStatus, Scores};
pub(crate) use merge::ComponentMerger;
pub use registration::{Registrar, Registration};
pub use submap::{QuerySubmap, Submaps};

use crate::index::{ClosureIdx, KeyframeIdx};
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::place_recognition::{CandidateOrigin, LoopCandidate, NEAR_MAX_M};
use crate::pose_graph::{KeyframeGraph, Prior, deviation};
use divergence::divergence;
use gates::{is_tight, judge};
use randt_config::Config;
use randt_geometry::{Pose2, elementary::PI};

/// Below this the estimate is a better start than what a keyframe looks like, rad: a sector.
const START_SIGMA_RAD: f64 = 0.1;
/// Headings within this many standard deviations, and one sector, of the estimate's are the same.
const HEADING_DEVIATIONS: f64 = 4.0;
/// Share of the radar's range within which the mixtures are compared: beyond it they were seen
/// from too far apart.
const DIVERGENCE_RANGE_SHARE: f64 = 0.6;

/// Submaps, the query that is registered against them, and the closures that it gave.
pub(crate) struct LoopVerification {
    config: Config,
    pub submaps: Submaps,
    query: QuerySubmap,
    registrar: Registrar,
    /// All that was registered so far, in order.
    pub closures: Vec<LoopClosure>,
}

impl LoopVerification {
    /// Nothing registered yet.
    pub fn new(config: &Config) -> Self {
        Self {
            submaps: Submaps::new(config),
            query: QuerySubmap::new(config),
            registrar: Registrar::new(config),
            closures: Vec::new(),
            config: config.clone(),
        }
    }

    /// Gives these closures, which left the graph, their status.
    pub fn withdraw(&mut self, pruned: &[ClosureIdx]) {
        for index in pruned {
            if let Some(closure) = self.closures.get_mut(index.0) {
                closure.status = LoopStatus::Withdrawn;
            }
        }
    }

    /// These closures are loops whose keyframes have left the graph, and their edges with them.
    pub fn drop_edges(&mut self, dropped: &[ClosureIdx]) {
        for index in dropped {
            if let Some(closure) = self.closures.get_mut(index.0) {
                closure.status = LoopStatus::Confirmed;
            }
        }
    }

    /// Registers the newest keyframe against the submaps of its candidates, each submap once, and
    /// takes what holds.
    pub fn verify(
        &mut self,
        candidates: &[LoopCandidate],
        keyframes: &KeyframeStore,
        graph: &mut KeyframeGraph,
    ) {
        if candidates.is_empty() {
            return;
        }
        self.query.build(keyframes);
        let mut tried: Vec<KeyframeIdx> = Vec::new();
        let first = self.closures.len();
        for candidate in candidates {
            let keyframe = keyframes.get(candidate.keyframe.0);
            if let Some(root) = keyframe.and_then(|it| self.submaps.root_of(it, keyframes))
                && !tried.contains(&root)
            {
                tried.push(root);
                let closure = self.close(candidate, root, keyframes, graph);
                self.closures.extend(closure);
            }
        }
        self.confirm(first, keyframes, graph);
    }

    /// Registers the newest keyframe to the submap of a candidate and judges the result.
    fn close(
        &mut self,
        candidate: &LoopCandidate,
        root: KeyframeIdx,
        keyframes: &KeyframeStore,
        graph: &mut KeyframeGraph,
    ) -> Option<LoopClosure> {
        let newest = keyframes.newest()?;
        let verify = self.config.loops.verify;
        let prior = graph.prior(root, newest).filter(|_| verify);
        if candidate.origin == CandidateOrigin::Proximity && prior.is_none() {
            return None;
        }
        let starts = self.starts(candidate, root, keyframes, prior.as_ref());
        let mut closure = self.measure([root, newest], &starts, candidate.origin, keyframes);
        if let Some(prior) = prior {
            closure.weigh(&prior);
            if starts.is_empty() {
                closure.older_from_newer = prior.older_from_newer;
                closure.scores.chi2 = None;
                closure.status = LoopStatus::AgainstOdometry;
                return Some(closure);
            }
        }
        if closure.scores.forward.is_none() {
            return Some(closure);
        }
        // Where odometry knows the heading, the opposite one is out of the question.
        if verify && prior.is_none_or(|prior| prior.sigma_rad() > START_SIGMA_RAD) {
            let pose = closure.older_from_newer;
            let flipped = Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad + PI);
            let flipped = self.register(root, &[flipped], keyframes);
            closure.scores.rival = Some(flipped.map_or(0.0, |flipped| flipped.fit()));
        }
        closure.status = self.status(&closure.scores);
        if let Some(prior) = prior
            && !is_tight(&prior)
            && closure.status == LoopStatus::Unconfirmed
        {
            self.seek_rivals(&mut closure, &prior, keyframes);
            closure.status = self.status(&closure.scores);
        }
        Some(closure)
    }

    /// What the gates say.
    fn status(&self, scores: &Scores) -> LoopStatus {
        let loops = &self.config.loops;
        let refused = judge(scores, loops).err().filter(|_| loops.verify);
        refused.unwrap_or(LoopStatus::Unconfirmed)
    }

    /// Registers the query, which ends at the newer keyframe, to the submap of the older one; what
    /// is not measured stays open.
    fn measure(
        &mut self,
        [older, newer]: [KeyframeIdx; 2],
        starts: &[Pose2],
        origin: CandidateOrigin,
        keyframes: &[MapKeyframe],
    ) -> LoopClosure {
        let mut closure = LoopClosure {
            older,
            newer,
            origin,
            ..LoopClosure::default()
        };
        let Some(registration) = self.register(older, starts, keyframes) else {
            return closure;
        };
        let pose = registration.submap_from_query;
        closure.older_from_newer = pose;
        closure.information = registration.information;
        let range_m = DIVERGENCE_RANGE_SHARE * self.config.range_used_m();
        let grid = self.submaps.grid(older, keyframes);
        let sees_all = self.query.sees_all && self.submaps.sees_all(older, keyframes);
        closure.scores = Scores {
            forward: Some(registration.forward),
            backward: Some(registration.backward),
            displaced: Some(registration.displaced),
            sigma_m: sees_all.then(|| registration.sigmas_m()[0]),
            divergence: grid.map(|grid| divergence(grid, &self.query.grid, &pose, range_m)),
            ..Scores::default()
        };
        closure
    }

    /// Where a registration may start: the estimate where it is sharp, else what the keyframe
    /// looks like, where odometry allows that.
    fn starts(
        &self,
        candidate: &LoopCandidate,
        root: KeyframeIdx,
        keyframes: &[MapKeyframe],
        prior: Option<&Prior>,
    ) -> Vec<Pose2> {
        let mut starts = Vec::from_iter(prior.map(|prior| prior.older_from_newer));
        if let CandidateOrigin::Appearance { yaw_rad, .. } = candidate.origin
            && let Some(keyframe) = keyframes.get(candidate.keyframe.0)
            && let Some(root) = keyframes.get(root.0)
        {
            let between = root.odom_from_base.between(&keyframe.odom_from_base);
            let look = between.compose(&Pose2::new(0.0, 0.0, yaw_rad));
            let Some(prior) = prior else {
                return vec![look];
            };
            let off = deviation(&prior.older_from_newer, &look);
            let sector = 2.0 * PI / f64::from(self.config.loops.sectors);
            let away_m = HEADING_DEVIATIONS * prior.sigma_m() + NEAR_MAX_M;
            let turned_rad = HEADING_DEVIATIONS * prior.sigma_rad() + 2.0 * sector;
            if off.z.abs() > turned_rad || off.xy().norm() > away_m {
                return Vec::new();
            }
            if prior.sigma_m() > 0.5 * self.config.cell_size_m() {
                starts.push(look);
            }
        }
        starts
    }

    /// The best of several registrations to one submap.
    fn register(
        &mut self,
        root: KeyframeIdx,
        starts: &[Pose2],
        keyframes: &[MapKeyframe],
    ) -> Option<Registration> {
        let grid = self.submaps.grid(root, keyframes)?;
        let register = |start| self.registrar.register(grid, &self.query, start);
        let registered = starts.iter().filter_map(register);
        registered.max_by(|a, b| a.fit().total_cmp(&b.fit()))
    }
}
