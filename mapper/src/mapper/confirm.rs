//! Which of the candidates that passed their gates enter the graph, within one part of the map.
//!
//! Where the estimate is sharp, a loop within its gate cannot be false and is taken alone. Where it is not, two of one
//! drive through a place must agree.

use super::Mapper;
use crate::{
    Candidate, Fate,
    verify::{CHI2_MAX, Prior},
};
use nalgebra::Matrix3;

/// Loops that agree must lie so many keyframe distances of path apart: neighbours share their errors.
const APART_KEYFRAMES: f64 = 2.0;
/// ... and at most so many: beyond it the drive between is no sharper than the estimate.
const TOGETHER_KEYFRAMES: f64 = 40.0;

impl Mapper {
    /// Takes the unconfirmed candidates from `first` on, and older ones that they confirm.
    pub(super) fn confirm(&mut self, first: usize) {
        let mut accepted = Vec::new();
        for new in first..self.candidates.len() {
            let Some(candidate) = self.candidates.get(new).copied() else {
                continue;
            };
            if candidate.fate != Fate::Unconfirmed {
                continue;
            }
            let prior = self.prior(candidate.from, candidate.to);
            if !self.config.loops.verify || prior.is_some_and(|prior| prior.is_tight()) {
                accepted.push(new);
            } else if prior.is_some() {
                let votes = self.votes(&candidate);
                if !votes.is_empty() {
                    accepted.extend(votes);
                    accepted.push(new);
                }
            }
        }
        accepted.sort_unstable();
        accepted.dedup();
        self.accept(&accepted);
    }

    /// Unconfirmed candidates of the last metres that agree with this one.
    fn votes(&mut self, candidate: &Candidate) -> Vec<usize> {
        let step_m = self.config.keyframe.distance_m;
        let path = |i: usize| self.places.get(i).map_or(0.0, |place| place.path_m);
        let here_m = path(candidate.to);
        let range_m = APART_KEYFRAMES * step_m..TOGETHER_KEYFRAMES * step_m;
        let others: Vec<usize> = self
            .candidates
            .iter()
            .enumerate()
            .filter(|(_, other)| other.fate == Fate::Unconfirmed)
            .filter(|(_, other)| range_m.contains(&(here_m - path(other.to))))
            .map(|(i, _)| i)
            .collect();
        others
            .into_iter()
            .filter(|&i| {
                let other = self.candidates.get(i).copied();
                other.is_some_and(|other| self.agree(&other, candidate))
            })
            .collect()
    }

    /// Whether two loops and the drives between their ends close up.
    fn agree(&mut self, a: &Candidate, b: &Candidate) -> bool {
        let (Some(old), Some(new)) = (self.prior(b.from, a.from), self.prior(a.to, b.to)) else {
            return false;
        };
        let (Some(of_a), Some(of_b)) = (a.information.try_inverse(), b.information.try_inverse())
        else {
            return false;
        };
        // b as the others say it is: back to a's old place, over loop a, on to b's new place.
        let onward = a.relative.compose(&new.pose);
        let carried = |covariance: &Matrix3<f64>, by: &randt_geometry::Pose2| {
            let adjoint = by.inverse().adjoint();
            adjoint * covariance * adjoint.transpose()
        };
        let expected = Prior {
            pose: old.pose.compose(&onward),
            covariance: carried(&old.covariance, &onward)
                + carried(&of_a, &new.pose)
                + new.covariance,
        };
        expected.chi2(&b.relative, &of_b) <= CHI2_MAX
    }

    /// Puts candidates into the graph and lets the map follow.
    pub(super) fn accept(&mut self, accepted: &[usize]) {
        if accepted.is_empty() {
            return;
        }
        for &index in accepted {
            let Some(candidate) = self.candidates.get_mut(index) else {
                continue;
            };
            match self.graph.add_loop(candidate.edge()) {
                Ok(id) => {
                    candidate.fate = Fate::Accepted;
                    self.loops.push((id, index));
                }
                Err(_) => candidate.fate = Fate::Degenerate,
            }
        }
        self.settle();
    }
}
