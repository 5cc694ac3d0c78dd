//! The drive once more from its beginning: every group of loops is held against what was known when it arrived.

use super::super::Error;
use super::super::covariance;
use super::super::edge::Edge;
use super::super::loss::Loss;
use super::super::solver::{Effort, Term, factorised, solve};
use super::super::system::System;
use super::groups::{Chain, GATE, NEAR_NODES};
use super::uncertain::Uncertain;
use randt_geometry::Pose2;

/// Before loops are held against it: those that passed the gate are near the optimum, and a centimetre decides nothing.
const EFFORT: Effort = Effort {
    step: 0.01,
    factorisations_max: 3,
};

/// Degrees of freedom of a loop.
const DOF: f64 = 3.0;
/// Innovations that the claimed covariances are worth before the data say how large errors are.
const CLAIM_COUNT: f64 = 2.0;

/// How large errors are taken to be: their variance relative to what the edges claim.
#[derive(Clone, Copy, Debug)]
pub(super) enum Noise {
    /// Known beforehand.
    Fixed(f64),
    /// As claimed at first, then as the innovations show: long drift may be worse than short cycles tell.
    Learned { sum: f64, count: f64 },
}

impl Noise {
    /// What nothing is known of but the claims.
    pub const CLAIMED: Self = Self::Learned {
        sum: CLAIM_COUNT,
        count: CLAIM_COUNT,
    };

    fn push(&mut self, chi2: f64) {
        if let Self::Learned { sum, count } = self {
            *sum += chi2 / DOF;
            *count += 1.0;
        }
    }

    fn variance(self) -> f64 {
        match self {
            Self::Fixed(variance) => variance,
            Self::Learned { sum, count } => sum / count,
        }
    }
}

/// What grew.
pub(super) struct Growth {
    pub poses: Vec<Pose2>,
    /// Which loops agreed when they arrived.
    pub on: Vec<bool>,
    /// Loops turned away that the claimed covariances would have let in.
    pub claimable: usize,
    /// Variance of the errors relative to what the edges claim.
    pub noise: f64,
}

/// Grows the estimate stretch by stretch.
pub(super) fn grow(
    poses: &[Pose2],
    odometry: &[Edge],
    loops: &[Edge],
    chain: &Chain<'_>,
    groups: &[Vec<usize>],
    joins: &[bool],
    mut noise: Noise,
) -> Result<Growth, Error> {
    let mut on = vec![false; loops.len()];
    let mut grown: Vec<Pose2> = Vec::with_capacity(poses.len());
    let mut system: Option<System> = None;
    let mut claimable = 0;
    let mut waiting = groups.iter().peekable();
    for begin in (0..poses.len()).step_by(NEAR_NODES) {
        let end = (begin + NEAR_NODES).min(poses.len());
        for node in begin..end {
            grown.push(extended(&grown, poses, chain, node));
        }
        let arrives = |group: &&Vec<usize>| group.last().is_some_and(|l| loops[*l].to < end);
        if !waiting.peek().is_some_and(arrives) {
            continue;
        }
        // What is known when they arrive.
        let known = &odometry[..odometry.partition_point(|edge| edge.to < end)];
        let closed = loops.iter().zip(&on).filter(|(_, on)| **on);
        let terms: Vec<Term<'_>> = (known.iter())
            .chain(closed.map(|(edge, _)| edge))
            .map(|edge| (edge, Loss::QUADRATIC))
            .collect();
        solve(&mut system, &mut grown, &terms, EFFORT)?;
        let system = factorised(&mut system, &grown, &terms)?;
        while let Some(group) = waiting.next_if(arrives) {
            // The middle one speaks for its group.
            let Some(speaker) = group.get(group.len() / 2) else {
                continue;
            };
            match innovation(&loops[*speaker], &grown, system)? {
                Some(chi2) if chi2 > GATE * noise.variance() => {
                    claimable += if chi2 < GATE { group.len() } else { 0 };
                    continue;
                }
                Some(chi2) => noise.push(chi2),
                // Nothing else joins the two parts: those that most others agree with do.
                None if !joins[*speaker] => continue,
                None => {}
            }
            group.iter().for_each(|l| on[*l] = true);
        }
    }
    Ok(Growth {
        poses: grown,
        on,
        claimable,
        noise: noise.variance(),
    })
}

/// chi2 of a loop by what is known of its two nodes; `None` where that is nothing.
fn innovation(edge: &Edge, grown: &[Pose2], system: &mut System) -> Result<Option<f64>, Error> {
    match covariance::relative(system, grown, edge.from, edge.to) {
        Ok(covariance) => {
            let pose = grown[edge.from].between(&grown[edge.to]);
            Ok(Some(Uncertain { pose, covariance }.disagreement(edge)))
        }
        Err(Error::NotConnected { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Where odometry puts the next node; where it begins anew, the estimate's own step.
fn extended(grown: &[Pose2], poses: &[Pose2], chain: &Chain<'_>, node: usize) -> Pose2 {
    match (chain.step(node), node.checked_sub(1)) {
        (Some(step), _) => grown[step.from].compose(&step.measured),
        (None, Some(before)) => grown[before].compose(&poses[before].between(&poses[node])),
        (None, None) => poses[node],
    }
}
