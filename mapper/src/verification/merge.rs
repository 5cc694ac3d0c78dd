//! Merges unconnected components of the map.
//!
//! A component has no prior against another: rooms and corridors that look alike give loops that
//! agree with one another for as long as the robot drives among them. So a component is merged by
//! the whole of its drive, not by single loops: laid over the other component it must fit wherever
//! the robot was there before, over a long way, and in no other alignment.

use super::LoopVerification;
use super::closure::{LoopClosure, LoopStatus};
use super::gates::{is_alike, is_fixed};
use super::way::Way;
use crate::index::{ComponentIdx, KeyframeIdx};
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::place_recognition::CandidateOrigin;
use crate::pose_graph::{KeyframeGraph, deviation};
use randt_config::Config;
use randt_geometry::Pose2;
use randt_persist::persist;

/// A component is tried again after this many keyframe distances of path.
const EVERY_KEYFRAMES: f64 = 8.0;
/// Submaps that must fit, two metres of path each indoors: fewer say too little together.
const FITS_MIN: usize = 16;
/// Share of their cells that the other component must explain, on the average. In eight drives
/// through a building whose halves and rooms look alike, true alignments have 0.76 to 0.87 and
/// false ones, of up to 44 fits, 0.54 to 0.71.
const EXPLAINED_MIN: f64 = 0.74;
/// Of the submaps that lie where the robot was before, this share may not fit: doors move, and
/// odometry bends.
const MISFITS_MAX: f64 = 0.1;
/// Another alignment of as good fits, this share of the best one's in number, makes both doubtful.
const RIVAL_SHARE: f64 = 0.5;
/// Alignments tried, by the number of loops that support them.
const ALIGNMENTS_MAX: usize = 5;
/// Alignments within these are one, m and rad: odometry's drift over a component.
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.1;
/// A submap is compared where the other component has a keyframe within this many keyframe
/// distances.
const NEAR_KEYFRAMES: f64 = 3.0;
/// A fit may end this far from where the alignment has it, m and rad: within [`SAME_M`] for the
/// drift of long components.
const OFF_MAX_M: f64 = 1.0;
const OFF_MAX_RAD: f64 = 0.08;

/// A way to lay one component over another.
struct Alignment {
    /// The other component.
    other: ComponentIdx,
    /// Frame of the newest component in that of the other one.
    other_from_newest: Pose2,
    /// Loops that support it.
    support: usize,
}

/// An alignment, and how the submaps fit there.
struct Overlay {
    alignment: Alignment,
    fits: Vec<LoopClosure>,
    misfits: usize,
}

impl Overlay {
    /// Share of the submaps' cells that the other component explains, on the average.
    fn explained(&self) -> f64 {
        let shares = self.fits.iter().filter_map(|fit| fit.scores.forward);
        shares.sum::<f64>() / self.fits.len().max(1) as f64
    }
}

/// Merges the newest component into an older one, where there is no doubt.
pub(crate) struct ComponentMerger {
    /// Path at which a merge was last tried, m.
    tried_m: f64,
    every_m: f64,
    near_m: f64,
    is_enabled: bool,
}
persist!(ComponentMerger { tried_m } kept { every_m, near_m, is_enabled });

impl ComponentMerger {
    /// Nothing tried yet.
    pub fn new(config: &Config) -> Self {
        Self {
            tried_m: f64::NEG_INFINITY,
            every_m: EVERY_KEYFRAMES * config.keyframe.distance_m,
            near_m: NEAR_KEYFRAMES * config.keyframe.distance_m,
            is_enabled: config.loops.verify,
        }
    }

    /// Merges the newest keyframe's component into another one, where there is no doubt.
    pub fn merge(
        &mut self,
        keyframes: &KeyframeStore,
        verification: &mut LoopVerification,
        graph: &mut KeyframeGraph,
    ) {
        let Some(newest) = keyframes.newest() else {
            return;
        };
        let path_m = keyframes.path_m();
        if !self.is_enabled || path_m - self.tried_m < self.every_m {
            return;
        }
        let component = graph.component_of(newest);
        let alignments = alignments(component, keyframes, verification, graph);
        if alignments.is_empty() {
            return;
        }
        self.tried_m = path_m;
        let overlay = |it| verification.overlay(component, it, self.near_m, keyframes, graph);
        let mut overlays: Vec<Overlay> = alignments.into_iter().map(overlay).collect();
        overlays.retain(|overlay| overlay.explained() >= EXPLAINED_MIN);
        overlays.sort_by_key(|overlay| core::cmp::Reverse(overlay.fits.len()));
        let mut overlays = overlays.into_iter();
        let Some(best) = overlays.next() else { return };
        let fits = best.fits.len();
        let mut rivals = overlays.filter(|rival| rival.alignment.other == best.alignment.other);
        let has_rival = rivals.any(|rival| rival.fits.len() as f64 > RIVAL_SHARE * fits as f64);
        let misfits_max = MISFITS_MAX * (fits + best.misfits) as f64;
        if fits >= FITS_MIN && best.misfits as f64 <= misfits_max && !has_rival {
            verification.align_component(component, best, graph);
        }
    }
}

/// The alignments that unconfirmed closures support, those with most of them first.
fn alignments(
    component: ComponentIdx,
    keyframes: &[MapKeyframe],
    verification: &LoopVerification,
    graph: &KeyframeGraph,
) -> Vec<Alignment> {
    let here = graph.poses().last().copied().unwrap_or_default();
    let mut alignments: Vec<Alignment> = Vec::new();
    for (_, closure) in verification.unconfirmed(0) {
        let [of_older, of_newer] = [closure.older, closure.newer].map(|k| graph.component_of(k));
        let poses = [closure.older, closure.newer].map(|k| graph.pose(k));
        let [Some(older), Some(newer)] = poses else {
            continue;
        };
        // Where the older keyframe's component has the frame of the newer one's.
        let map_from_newer = older.compose(&closure.older_from_newer);
        let older_from_newer = map_from_newer.compose(&newer.inverse());
        let (other, other_from_newest) = match (of_older == component, of_newer == component) {
            (false, true) => (of_older, older_from_newer),
            (true, false) => (of_newer, older_from_newer.inverse()),
            _ => continue,
        };
        // Alignments are one where they have the robot in one position.
        let robot = other_from_newest.compose(&here);
        let same = alignments.iter_mut().find(|alignment| {
            let off = deviation(&alignment.other_from_newest.compose(&here), &robot);
            alignment.other == other && off.xy().norm() < SAME_M && off.z.abs() < SAME_RAD
        });
        match same {
            Some(alignment) => alignment.support += 1,
            None => alignments.push(Alignment {
                other,
                other_from_newest,
                support: 1,
            }),
        }
    }
    alignments.retain(|alignment| is_reachable(component, alignment, keyframes, graph));
    alignments.sort_by_key(|alignment| core::cmp::Reverse(alignment.support));
    alignments.truncate(ALIGNMENTS_MAX);
    alignments
}

/// Whether the robot can have come from the one component to the other in the time between, by the
/// ways that it drove meanwhile in others.
fn is_reachable(
    component: ComponentIdx,
    alignment: &Alignment,
    keyframes: &[MapKeyframe],
    graph: &KeyframeGraph,
) -> bool {
    let speeds = keyframes.iter().map(|keyframe| keyframe.speed_m_s);
    let fastest_m_s = speeds.fold(0.0, f64::max);
    let mut before: Option<(ComponentIdx, Pose2)> = None;
    let mut way = Way::default();
    for (index, (keyframe, pose)) in keyframes.iter().zip(graph.poses()).enumerate() {
        way.go_on(keyframe, fastest_m_s);
        let own = graph.component_of(KeyframeIdx(index));
        let pose = match own {
            own if own == component => alignment.other_from_newest.compose(pose),
            own if own == alignment.other => *pose,
            _ => continue,
        };
        if let Some((last, from)) = before
            && last != own
            && !way.may_end_at(&from.between(&pose))
        {
            return false;
        }
        before = Some((own, pose));
        way = Way::from(keyframe);
    }
    true
}

impl LoopVerification {
    /// Lays a component over another one and registers each of its submaps' roots where the other
    /// component has been.
    fn overlay(
        &mut self,
        component: ComponentIdx,
        alignment: Alignment,
        near_m: f64,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Overlay {
        let roots: Vec<KeyframeIdx> = self.submaps.roots().collect();
        let (mut fits, mut misfits) = (Vec::new(), 0);
        for newer in roots {
            let pose = graph.pose(newer);
            let is_own = graph.component_of(newer) == component && graph.is_unknown(newer);
            let Some(pose) = pose.filter(|_| is_own) else {
                continue;
            };
            let expected = alignment.other_from_newest.compose(pose);
            let older = self.root_near(&expected, alignment.other, near_m, keyframes, graph);
            match older.map(|older| self.fit([older, newer], &expected, keyframes, graph)) {
                Some(Some(closure)) => fits.push(closure),
                // What saw too little says nothing against it.
                Some(None) if self.query.sees_all => misfits += 1,
                _ => {}
            }
        }
        Overlay {
            alignment,
            fits,
            misfits,
        }
    }

    /// The submap of the keyframe of a component that is nearest to a pose, by its root.
    fn root_near(
        &self,
        pose: &Pose2,
        component: ComponentIdx,
        near_m: f64,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Option<KeyframeIdx> {
        let near = graph.poses().iter().enumerate().filter_map(|(index, at)| {
            let away_m = (at.translation() - pose.translation()).norm();
            let keyframe = KeyframeIdx(index);
            let is_own = graph.component_of(keyframe) == component && graph.is_unknown(keyframe);
            (is_own && away_m <= near_m).then_some((away_m, index))
        });
        let (_, nearest) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
        self.submaps.root_of(keyframes.get(nearest)?, keyframes)
    }

    /// Registers a keyframe to a submap near where it is expected to be in the submap's component;
    /// `None` where it does not fit. One that fits as well a metre on counts too, but makes no
    /// loop.
    fn fit(
        &mut self,
        [older, newer]: [KeyframeIdx; 2],
        expected: &Pose2,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Option<LoopClosure> {
        self.query.build(keyframes.get(..=newer.0)?);
        let start = graph.pose(older)?.between(expected);
        let origin = CandidateOrigin::Proximity;
        let mut closure = self.measure([older, newer], &[start], origin, keyframes);
        let off = deviation(&start, &closure.older_from_newer);
        let is_near = off.xy().norm() < OFF_MAX_M && off.z.abs() < OFF_MAX_RAD;
        if !is_near || is_alike(&closure.scores, &self.config.loops).is_err() {
            return None;
        }
        let fixed = is_fixed(&closure.scores);
        closure.status = fixed.err().unwrap_or(LoopStatus::Unconfirmed);
        Some(closure)
    }

    /// Moves a component to its alignment and takes its fits as loops.
    fn align_component(
        &mut self,
        component: ComponentIdx,
        overlay: Overlay,
        graph: &mut KeyframeGraph,
    ) {
        let (other, moved) = (overlay.alignment.other, overlay.alignment.other_from_newest);
        // The older component keeps its coordinates.
        if other < component {
            graph.move_component(component, &moved);
        } else {
            graph.move_component(other, &moved.inverse());
        }
        let first = self.closures.len();
        self.closures.extend(overlay.fits);
        let loops: Vec<_> = self.unconfirmed(first).map(|(index, _)| index).collect();
        self.accept(&loops, graph);
    }
}
