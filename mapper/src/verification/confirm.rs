//! Which of the closures that passed their gates enter the graph, within one component of the map.
//!
//! Where the estimate is sharp, a loop within its gate cannot be false and is taken alone. Where
//! it is not, two of one passage must agree. One that tells the graph nothing confirms it and
//! costs no edge: on known ground edges would grow with the way driven.

use super::LoopVerification;
use super::closure::{LoopClosure, LoopStatus};
use super::gates::{CHI2_MAX, is_tight};
use crate::index::{ClosureIdx, KeyframeIdx};
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::pose_graph::{KeyframeGraph, Prior};
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// Loops that agree must lie this many keyframe distances of path apart: neighbours share their
/// errors.
const APART_KEYFRAMES: f64 = 2.0;
/// ... and at most this many: beyond it the drive between is no sharper than the estimate.
const TOGETHER_KEYFRAMES: f64 = 40.0;

/// A loop that tells less, nats, is no news: the graph knows as well as the loop how its keyframes
/// lie, the two covariances being of one volume (three halves of the logarithm of two). At 2.0 the
/// building's map is 0.060 m off instead of 0.044, at 1.04 0.049.
const NEWS_MIN: f64 = 1.04;
/// chi2 of three degrees of freedom that one true loop in twenty exceeds: beyond it a loop says
/// something else than the estimate, however sure that is.
const EXPECTED_CHI2_MAX: f64 = 7.8;

impl LoopVerification {
    /// Takes the unconfirmed closures from one on, and older ones that they support.
    pub(super) fn confirm(
        &mut self,
        first: usize,
        keyframes: &KeyframeStore,
        graph: &mut KeyframeGraph,
    ) {
        let mut holding = Vec::new();
        for (index, closure) in self.unconfirmed(first) {
            let prior = graph.prior(closure.older, closure.newer);
            if !self.config.loops.verify || prior.is_some_and(|prior| is_tight(&prior)) {
                holding.push(index);
            } else if prior.is_some() {
                let support = self.support(closure, keyframes, graph);
                if !support.is_empty() {
                    holding.extend(support);
                    holding.push(index);
                }
            }
        }
        if !self.config.loops.verify {
            self.accept(&holding, graph);
            return;
        }
        // To the oldest keyframes first: laps that hold to the first one leave the graph as sparse
        // as that.
        holding
            .sort_unstable_by_key(|index| (self.closures.get(index.0).map(|it| it.older), *index));
        holding.dedup();
        for index in holding {
            if self.has_news(index, graph) {
                self.accept(&[index], graph);
            } else if let Some(closure) = self.closures.get_mut(index.0) {
                closure.status = LoopStatus::Confirmed;
            }
        }
    }

    /// Whether a closure that holds says more than the graph knows by now.
    fn has_news(&self, index: ClosureIdx, graph: &mut KeyframeGraph) -> bool {
        let closure = self.closures.get(index.0);
        let prior = closure.and_then(|it| graph.prior(it.older, it.newer));
        let covariance = closure.and_then(|it| it.information.try_inverse());
        let (Some(closure), Some(prior), Some(covariance)) = (closure, prior, covariance) else {
            return true;
        };
        prior.information_gain(&covariance) >= NEWS_MIN
            || prior.chi2(&closure.older_from_newer, &covariance) > EXPECTED_CHI2_MAX
    }

    /// Unconfirmed closures of the last metres that agree with this one.
    fn support(
        &self,
        closure: &LoopClosure,
        keyframes: &[MapKeyframe],
        graph: &mut KeyframeGraph,
    ) -> Vec<ClosureIdx> {
        let step_m = self.config.keyframe.distance_m;
        let path_m = |i: KeyframeIdx| keyframes.get(i.0).map_or(0.0, |keyframe| keyframe.path_m);
        let here_m = path_m(closure.newer);
        let range_m = APART_KEYFRAMES * step_m..TOGETHER_KEYFRAMES * step_m;
        self.unconfirmed(0)
            .filter(|(_, other)| range_m.contains(&(here_m - path_m(other.newer))))
            .filter(|(_, other)| agree(other, closure, graph))
            .map(|(index, _)| index)
            .collect()
    }

    /// The closures that are unconfirmed, from one on.
    pub(super) fn unconfirmed(
        &self,
        first: usize,
    ) -> impl Iterator<Item = (ClosureIdx, &LoopClosure)> {
        let closures = self.closures.iter().enumerate().skip(first);
        let unconfirmed = closures.filter(|(_, it)| it.status == LoopStatus::Unconfirmed);
        unconfirmed.map(|(index, closure)| (ClosureIdx(index), closure))
    }

    /// Puts closures into the graph and lets the map follow.
    pub(super) fn accept(&mut self, accepted: &[ClosureIdx], graph: &mut KeyframeGraph) {
        if accepted.is_empty() {
            return;
        }
        for &index in accepted {
            if let Some(closure) = self.closures.get_mut(index.0) {
                closure.status = match graph.add_closure(index, closure.edge()) {
                    Ok(()) => LoopStatus::Accepted,
                    Err(_) => LoopStatus::Degenerate,
                };
            }
        }
        let pruned = graph.optimize_and_prune();
        self.withdraw(&pruned);
    }
}

/// Whether two closures and the drives between their ends close up.
fn agree(a: &LoopClosure, b: &LoopClosure, graph: &mut KeyframeGraph) -> bool {
    let drives = [(b.older, a.older), (a.newer, b.newer)];
    let [Some(old), Some(new)] = drives.map(|(from, to)| graph.prior(from, to)) else {
        return false;
    };
    let covariances = [a, b].map(|closure| closure.information.try_inverse());
    let [Some(a_covariance), Some(b_covariance)] = covariances else {
        return false;
    };
    // b as the others say it is: back to a's old keyframe, over loop a, on to b's new keyframe.
    let onward = a.older_from_newer.compose(&new.older_from_newer);
    let carried = |covariance: &Matrix3<f64>, by: &Pose2| {
        let adjoint = by.inverse().adjoint();
        adjoint * covariance * adjoint.transpose()
    };
    let expected = Prior {
        older_from_newer: old.older_from_newer.compose(&onward),
        covariance: carried(&old.covariance, &onward)
            + carried(&a_covariance, &new.older_from_newer)
            + new.covariance,
    };
    expected.chi2(&b.older_from_newer, &b_covariance) <= CHI2_MAX
}
