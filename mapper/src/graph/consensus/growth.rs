//! The drive once more from its beginning: every group of loops is held against what was known when it arrived.

use super::super::Error;
use super::super::covariance;
use super::super::edge::Edge;
use super::super::loss::Loss;
use super::super::solver::{Effort, Term, solve};
use super::super::system::System;
use super::groups::{Chain, NEAR_NODES};
use super::hearing::Case;
use super::uncertain::Uncertain;
use randt_geometry::Pose2;

/// After each stretch: loops that passed the gate are near the optimum, and a centimetre decides nothing.
const EFFORT: Effort = Effort {
    step: 0.01,
    factorisations_max: 3,
};

/// Grows the estimate stretch by stretch; gives poses and which loops agreed when they arrived.
pub(super) fn grow(
    poses: &[Pose2],
    case: &Case<'_>,
    chain: &Chain<'_>,
    groups: &[Vec<usize>],
) -> Result<(Vec<Pose2>, Vec<bool>), Error> {
    let Case {
        loops, odometry, ..
    } = *case;
    let mut on = vec![false; loops.len()];
    let mut grown: Vec<Pose2> = Vec::with_capacity(poses.len());
    let mut system: Option<System> = None;
    let mut waiting = groups.iter().peekable();
    for begin in (0..poses.len()).step_by(NEAR_NODES) {
        let end = (begin + NEAR_NODES).min(poses.len());
        for node in begin..end {
            grown.push(extended(&grown, poses, chain, node));
        }
        let known = &odometry[..odometry.partition_point(|edge| edge.to < end)];
        let arrives = |group: &&Vec<usize>| group.last().is_some_and(|l| loops[*l].to < end);
        let mut arrived = Vec::new();
        while let Some(group) = waiting.next_if(arrives) {
            arrived.push(group);
        }
        let mut agreed = false;
        for group in arrived {
            // The middle one speaks for its group.
            let speaker = group.get(group.len() / 2).map(|l| &loops[*l]);
            if let Some(speaker) = speaker
                && fits(speaker, &grown, system.as_mut(), known, case.gate)?
            {
                group.iter().for_each(|l| on[*l] = true);
                agreed = true;
            }
        }
        if agreed {
            let closed = loops.iter().zip(&on).filter(|(_, on)| **on);
            let terms: Vec<Term<'_>> = (known.iter())
                .chain(closed.map(|(edge, _)| edge))
                .map(|edge| (edge, Loss::QUADRATIC))
                .collect();
            solve(&mut system, &mut grown, &terms, EFFORT)?;
        }
    }
    Ok((grown, on))
}

/// Whether a loop lies within what is known of its two nodes.
fn fits(
    edge: &Edge,
    grown: &[Pose2],
    system: Option<&mut System>,
    known: &[Edge],
    gate: f64,
) -> Result<bool, Error> {
    match covariance::relative(system, grown, known, edge.from, edge.to) {
        Ok(covariance) => {
            let pose = grown[edge.from].between(&grown[edge.to]);
            Ok(Uncertain { pose, covariance }.disagreement(edge) <= gate)
        }
        // Nothing else joins the two parts: nothing contradicts it.
        Err(Error::NotConnected { .. }) => Ok(true),
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
