//! The drive once more from its beginning: every group of loops is held against what was known when it arrived.

use super::super::covariance;
use super::super::edge::Edge;
use super::super::loss::Loss;
use super::super::solver::{Term, solve};
use super::super::system::System;
use super::super::Error;
use super::groups::{Chain, GATE, Groups, NEAR_NODES};
use super::uncertain::Uncertain;
use randt_geometry::Pose2;

/// Steps of Gauss-Newton after each stretch: loops that passed the gate are near the optimum.
const STEPS: usize = 2;

/// Grows the estimate stretch by stretch; gives poses and which loops agreed when they arrived.
pub(super) fn grow(
    poses: &[Pose2],
    odometry: &[Edge],
    loops: &[Edge],
    chain: &Chain<'_>,
    groups: &Groups,
) -> Result<(Vec<Pose2>, Vec<bool>), Error> {
    let mut on = vec![false; loops.len()];
    let mut grown: Vec<Pose2> = Vec::with_capacity(poses.len());
    let mut system: Option<System> = None;
    let mut waiting = groups.groups.iter().peekable();
    let gate = GATE * groups.noise;
    let (mut t_solve, mut t_cov) = (std::time::Duration::ZERO, std::time::Duration::ZERO);
    let (mut n_solve, mut n_cov) = (0, 0);
    for begin in (0..poses.len()).step_by(NEAR_NODES) {
        let end = (begin + NEAR_NODES).min(poses.len());
        for node in begin..end {
            grown.push(extended(&grown, poses, chain, node));
        }
        let known = &odometry[..odometry.partition_point(|edge| edge.to < end)];
        let mut arrived = Vec::new();
        while let Some(group) = waiting.next_if(|group| group.last().is_some_and(|l| loops[*l].to < end)) {
            arrived.push(group);
        }
        // What most loops say is heard first.
        arrived.sort_by_key(|group| std::cmp::Reverse(group.len()));
        let mut agreed = false;
        for group in arrived {
            let Some(edge) = group.get(group.len() / 2).map(|l| &loops[*l]) else { continue };
            let t = std::time::Instant::now();
            let covariance = covariance::relative(system.as_mut(), &grown, known, edge.from, edge.to);
            t_cov += t.elapsed(); n_cov += 1;
            let fits = match covariance {
                Ok(covariance) => {
                    let pose = grown[edge.from].between(&grown[edge.to]);
                    Uncertain { pose, covariance }.disagreement(edge) <= gate
                }
                // Nothing else joins the two parts: nothing contradicts it.
                Err(Error::NotConnected { .. }) => true,
                Err(error) => return Err(error),
            };
            if fits {
                group.iter().for_each(|l| on[*l] = true);
                agreed = true;
            }
        }
        if agreed {
            let t = std::time::Instant::now();
            let closed = loops.iter().zip(&on).filter(|(_, on)| **on).map(|(edge, _)| edge);
            let terms: Vec<Term<'_>> =
                known.iter().chain(closed).map(|edge| (edge, Loss::QUADRATIC)).collect();
            solve(&mut system, &mut grown, &terms, STEPS)?;
            t_solve += t.elapsed(); n_solve += 1;
        }
    }
    eprintln!("growth: {n_solve} solves {t_solve:?}, {n_cov} covs {t_cov:?}");
    Ok((grown, on))
}

/// Where odometry puts the next node; where it begins anew, the estimate's own step.
fn extended(grown: &[Pose2], poses: &[Pose2], chain: &Chain<'_>, node: usize) -> Pose2 {
    match (chain.step(node), node.checked_sub(1)) {
        (Some(step), _) => grown[step.from].compose(&step.measured),
        (None, Some(before)) => grown[before].compose(&poses[before].between(&poses[node])),
        (None, None) => poses[node],
    }
}
