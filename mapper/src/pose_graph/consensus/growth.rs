//! The drive once more from its beginning: every cluster of loops is held against what was known
//! when it arrived.

use super::super::Error;
use super::super::covariance;
use super::super::edge::Edge;
use super::super::solver::{Effort, believed, factorised, solve};
use super::super::system::System;
use super::chance::Chance;
use super::clusters::{GATE, NEAR_NODES, OdometryChain};
use super::uncertain::{Innovation, Uncertain};
use crate::index::KeyframeIdx;
use randt_geometry::Pose2;

/// Before loops are held against it: a step of a decimetre leaves a centimetre, and that decides
/// nothing.
const EFFORT: Effort = Effort {
    step: 0.1,
    factorisations_max: 3,
};

/// Stretches that a long drive grows by, each an optimisation of what there is: at 10,000 nodes one
/// takes a tenth of a second.
const STRETCHES_MAX: usize = 30;

/// Degrees of freedom of a loop.
const DOF: f64 = 3.0;
/// Innovations that the claimed covariances are worth before the data show how large errors are.
const CLAIM_COUNT: f64 = 2.0;

/// How large errors are taken to be: their variance relative to what the edges claim.
#[derive(Clone, Copy, Debug)]
pub(super) enum Noise {
    /// Known beforehand.
    Fixed(f64),
    /// As claimed at first, then as the innovations show: long drift may be worse than short
    /// cycles show.
    Learned { sum: f64, count: f64 },
}

impl Noise {
    /// Only the claims are known.
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
    chain: &OdometryChain<'_>,
    clusters: &[Vec<usize>],
    connects: &[bool],
    mut noise: Noise,
) -> Result<Growth, Error> {
    let mut on = vec![false; loops.len()];
    let mut grown: Vec<Pose2> = Vec::with_capacity(poses.len());
    let mut system: Option<System> = None;
    let mut claimable = 0;
    let lone = clusters.iter().filter(|cluster| cluster.len() == 1).count();
    let mut waiting = clusters.iter().peekable();
    let stretch = NEAR_NODES.max(poses.len() / STRETCHES_MAX);
    for begin in (0..poses.len()).step_by(stretch) {
        let end = (begin + stretch).min(poses.len());
        for node in begin..end {
            grown.push(extended(&grown, poses, chain, node));
        }
        let arrives = |cluster: &&Vec<usize>| cluster.last().is_some_and(|l| loops[*l].to.0 < end);
        if !waiting.peek().is_some_and(arrives) {
            continue;
        }
        // What is known when they arrive.
        let known = &odometry[..odometry.partition_point(|edge| edge.to.0 < end)];
        let terms = believed(known, loops, &on);
        solve(&mut system, &mut grown, &terms, EFFORT)?;
        let system = factorised(&mut system, &grown, &terms)?;
        let chance = Chance::new(lone, &grown);
        while let Some(cluster) = waiting.next_if(arrives) {
            // The middle one stands for its cluster.
            let Some(representative) = cluster.get(cluster.len() / 2) else {
                continue;
            };
            let gate = GATE * noise.variance();
            match innovation(&loops[*representative], &grown, system)? {
                Some(found) if found.chi2 > gate => {
                    claimable += if found.chi2 < GATE { cluster.len() } else { 0 };
                    continue;
                }
                // It waits until more is known.
                Some(found) if cluster.len() == 1 && !chance.is_out(&found, gate) => continue,
                Some(found) => noise.push(found.chi2),
                // Nothing else connects the two components: those that most others agree with do.
                None if !connects[*representative] => continue,
                None => align(&mut grown, &loops[*representative], system),
            }
            cluster.iter().for_each(|l| on[*l] = true);
        }
    }
    Ok(Growth {
        poses: grown,
        on,
        claimable,
        noise: noise.variance(),
    })
}

/// A loop against what is known of its two nodes; `None` where that is nothing.
pub(super) fn innovation(
    edge: &Edge,
    grown: &[Pose2],
    system: &System,
) -> Result<Option<Innovation>, Error> {
    match covariance::relative(system, grown, edge.from, edge.to) {
        Ok(covariance) => {
            let pose = grown[edge.from.0].between(&grown[edge.to.0]);
            Ok(Some(Uncertain { pose, covariance }.innovation(edge)))
        }
        Err(Error::NotConnected { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Moves the component that a loop leads to, where the loop has it: from any heading the solver
/// would take long.
fn align(grown: &mut [Pose2], edge: &Edge, system: &System) {
    let there = grown[edge.from.0].compose(&edge.measured);
    let moved = there.compose(&grown[edge.to.0].inverse());
    for (node, pose) in grown.iter_mut().enumerate() {
        if system.connected(KeyframeIdx(node), edge.to) {
            *pose = moved.compose(pose);
        }
    }
}

/// Where odometry puts the next node; where it begins anew, the estimate's own step.
fn extended(grown: &[Pose2], poses: &[Pose2], chain: &OdometryChain<'_>, node: usize) -> Pose2 {
    match (chain.step(node), node.checked_sub(1)) {
        (Some(step), _) => grown[step.from.0].compose(&step.measured),
        (None, Some(before)) => grown[before].compose(&poses[before].between(&poses[node])),
        (None, None) => poses[node],
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{
        add_intra_submap_constraints, close, drifting, edge, square,
    };
    use super::super::clusters::clusters;
    use super::*;

    fn grown(odometry: &[Edge], poses: &[Pose2], loops: &[Edge], connects: bool) -> Growth {
        let chain = OdometryChain::new(poses.len(), odometry);
        let clusters = clusters(&chain, loops).0;
        let connects = vec![connects; loops.len()];
        grow(
            poses,
            odometry,
            loops,
            &chain,
            &clusters,
            &connects,
            Noise::CLAIMED,
        )
        .unwrap()
    }

    #[test]
    fn loops_within_the_drift_since_the_last_ones_are_let_in() {
        let mut graph = drifting(120);
        add_intra_submap_constraints(&mut graph);
        close(&mut graph, 3);
        let mut loops: Vec<Edge> = graph.loops().iter().map(|l| l.edge.clone()).collect();
        // Where the laps before are closed already, three metres are beyond all drift.
        let wrong = square(70)
            .between(&square(110))
            .compose(&Pose2::new(3.0, 0.0, 0.0));
        let at = loops.partition_point(|edge| edge.to.0 <= 110);
        loops.insert(at, edge(70, 110, wrong));
        let mut odometry = graph.odometry().to_vec();
        odometry.sort_by_key(|edge| edge.to);
        let growth = grown(&odometry, graph.poses(), &loops, true);
        let off: Vec<usize> = (0..loops.len()).filter(|l| !growth.on[*l]).collect();
        assert_eq!(off, [at]);
        assert!(growth.noise < 1.0, "{}", growth.noise);
    }

    #[test]
    fn only_a_loop_that_may_connects_two_components() {
        let graph = drifting(80);
        let odometry: Vec<Edge> = graph
            .odometry()
            .iter()
            .filter(|edge| edge.to.0 != 41)
            .cloned()
            .collect();
        let loops = [edge(5, 45, square(5).between(&square(45)))];
        assert_eq!(grown(&odometry, graph.poses(), &loops, false).on, [false]);
        assert_eq!(grown(&odometry, graph.poses(), &loops, true).on, [true]);
    }

    #[test]
    fn noise_is_what_the_innovations_show() {
        let mut noise = Noise::CLAIMED;
        assert_eq!(noise.variance(), 1.0);
        (0..98).for_each(|_| noise.push(4.0 * DOF));
        assert!((noise.variance() - 3.94).abs() < 1e-12);
        let mut fixed = Noise::Fixed(2.0);
        fixed.push(100.0);
        assert_eq!(fixed.variance(), 2.0);
    }
}
