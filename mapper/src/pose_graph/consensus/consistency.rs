//! Consistency of all loops: truncated least squares, and clusters that were turned away tried
//! against those that hold.
//!
//! A false cluster that came first, where nothing contradicted it yet, turns the true ones away
//! that come after. What the whole drive says of either is the truncated least squares: odometry's
//! chi2, and for every loop its own, at most the gate's.

use super::super::Error;
use super::super::edge::Edge;
use super::super::loss::Loss;
use super::super::solver::{Effort, Term, believed, factorised, solve};
use super::super::system::System;
use super::chance::Chance;
use super::clusters::GATE;
use super::growth::innovation;
use randt_geometry::{Pose2, elementary::ln};

/// For the estimate to bend to a cluster that is tried, and to converge with it; only the sum of
/// squares counts.
const EFFORT: Effort = Effort {
    step: 1e-3,
    factorisations_max: 12,
};
/// A loop this many gates off is off however little those that enter still move the estimate.
const NEAR: f64 = 4.0;
/// Degrees of freedom of a loop.
const DOF: f64 = 3.0;
/// Clusters tried in one re-check, largest first; the next re-check tries the others.
const TRIED_MAX: usize = 12;
/// Rounds in which loops enter and leave at the optimum until none does.
const ROUNDS_MAX: usize = 8;

/// An estimate with the loops that it believes.
#[derive(Clone)]
pub(super) struct ConsensusResult {
    pub poses: Vec<Pose2>,
    pub on: Vec<bool>,
    /// The truncated sum of squares.
    pub cost: f64,
}

/// Odometry and loops whose consistency is in question.
pub(super) struct Problem<'a> {
    pub odometry: &'a [Edge],
    pub loops: &'a [Edge],
    /// chi2 beyond which a loop is false.
    pub gate: f64,
}

impl Problem<'_> {
    /// Tries the clusters of which no loop is on, and takes those with which the whole fits
    /// better.
    pub fn reinstate(
        &self,
        clusters: &[Vec<usize>],
        mut result: ConsensusResult,
    ) -> Result<ConsensusResult, Error> {
        let is_off = |cluster: &&Vec<usize>| cluster.iter().all(|l| !result.on[*l]);
        let mut tried: Vec<_> = clusters.iter().filter(is_off).collect();
        tried.retain(|cluster| cluster.len() > 1);
        tried.sort_by_key(|cluster| std::cmp::Reverse(cluster.len()));
        for cluster in tried.into_iter().take(TRIED_MAX) {
            if cluster.iter().any(|l| result.on[*l]) {
                continue;
            }
            if let Some(better) = self.with_cluster(cluster, &result)? {
                result = better;
            }
        }
        Ok(result)
    }

    /// Believes a cluster in full and doubts every other loop; a result where the whole fits
    /// better so.
    fn with_cluster(
        &self,
        cluster: &[usize],
        result: &ConsensusResult,
    ) -> Result<Option<ConsensusResult>, Error> {
        let mut poses = result.poses.clone();
        let believed = cluster.iter().map(|l| (&self.loops[*l], Loss::QUADRATIC));
        let doubted = Loss::Scaled { phi: self.gate };
        let others = self.loops.iter().zip(&result.on).filter(|(_, on)| **on);
        let terms: Vec<Term<'_>> = (self.odometry.iter().map(|edge| (edge, Loss::QUADRATIC)))
            .chain(others.map(|(edge, _)| (edge, doubted)))
            .chain(believed)
            .collect();
        solve(&mut None, &mut poses, &terms, EFFORT)?;
        // Converging gains little more than the cluster itself: what is far worse already need not
        // converge.
        if self.cost(&poses) > result.cost + self.gate * cluster.len() as f64 {
            return Ok(None);
        }
        let on = self.agreeing(&poses);
        let solved = self.solve_truncated(poses, on)?;
        let won = solved.cost < result.cost && cluster.iter().any(|l| solved.on[*l]);
        Ok(won.then_some(solved))
    }

    /// Takes back loops that were turned away and lie, by what is known of their nodes in the end,
    /// within their claims, where no false one would be as near by chance: noise is a mean, and
    /// good loops have tails. The innovation's chi2 is what it adds to the sum of squares.
    pub fn readmit(&self, mut result: ConsensusResult) -> Result<ConsensusResult, Error> {
        let mut system: Option<System> = None;
        let off = result.on.iter().enumerate().filter(|(_, on)| !**on);
        let mut waiting: Vec<usize> = off.map(|(l, _)| l).collect();
        for _ in 0..ROUNDS_MAX {
            let terms = believed(self.odometry, self.loops, &result.on);
            solve(&mut system, &mut result.poses, &terms, EFFORT)?;
            let system = factorised(&mut system, &result.poses, &terms)?;
            let off = result.on.iter().filter(|on| !**on).count();
            let chance = Chance::new(off, &result.poses);
            // Nearer than a true loop is on the average is no nearer.
            let mean = self.gate / GATE * DOF;
            let (mut entering, mut near) = (Vec::new(), Vec::new());
            for l in waiting {
                match innovation(&self.loops[l], &result.poses, system)? {
                    Some(found) if found.chi2 > NEAR * GATE.max(self.gate) => {}
                    Some(found)
                        if found.chi2 <= GATE.max(self.gate)
                            && chance.is_out(&found, found.chi2.max(mean)) =>
                    {
                        entering.push(l);
                    }
                    _ => near.push(l),
                }
            }
            if entering.is_empty() {
                break;
            }
            entering.iter().for_each(|l| result.on[*l] = true);
            waiting = near;
        }
        Ok(result)
    }

    /// Optimises over the loops that are on; those that agree then enter, those that do not leave.
    pub fn solve_truncated(
        &self,
        mut poses: Vec<Pose2>,
        mut on: Vec<bool>,
    ) -> Result<ConsensusResult, Error> {
        let mut system: Option<System> = None;
        for round in 1.. {
            let terms = believed(self.odometry, self.loops, &on);
            solve(&mut system, &mut poses, &terms, EFFORT)?;
            let agreeing = self.agreeing(&poses);
            if agreeing == on || round > ROUNDS_MAX {
                break;
            }
            on = agreeing;
        }
        let cost = self.cost(&poses);
        Ok(ConsensusResult { poses, on, cost })
    }

    /// Minus twice the log likelihood, but for a constant, with the variance that fits the loops
    /// that are on; what is off is an outlier, whose price does not depend on that variance.
    pub fn deviance(&self, result: &ConsensusResult) -> f64 {
        let off = result.on.iter().filter(|on| !**on).count() as f64;
        let freedom = DOF * (result.on.len() as f64 - off + 1.0);
        let square = result.cost - self.gate * off;
        freedom * ln((square + DOF) / freedom) + GATE * off
    }

    /// The truncated sum of squares.
    fn cost(&self, poses: &[Pose2]) -> f64 {
        let odometry = self.odometry.iter().map(|edge| edge.chi2(poses));
        let truncated = |edge: &Edge| edge.chi2(poses).min(self.gate);
        let loops = self.loops.iter().map(truncated);
        odometry.sum::<f64>() + loops.sum::<f64>()
    }

    fn agreeing(&self, poses: &[Pose2]) -> Vec<bool> {
        let agrees = |edge: &Edge| edge.chi2(poses) <= self.gate;
        self.loops.iter().map(agrees).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{drifting, edge, square};
    use super::*;

    /// One lap back at these steps, wrong by this many metres.
    fn back(steps: &[usize], x_m: f64) -> Vec<Edge> {
        let wrong = Pose2::new(x_m, 0.0, 0.0);
        steps
            .iter()
            .map(|&to| {
                edge(
                    to - 40,
                    to,
                    square(to - 40).between(&square(to)).compose(&wrong),
                )
            })
            .collect()
    }

    fn solved(loops: &[Edge], on: &[bool], check: impl Fn(&Problem<'_>, ConsensusResult)) {
        let graph = drifting(60);
        let problem = Problem {
            odometry: graph.odometry(),
            loops,
            gate: GATE,
        };
        let result = problem
            .solve_truncated(graph.poses().to_vec(), on.to_vec())
            .unwrap();
        check(&problem, result);
    }

    #[test]
    fn loops_that_agree_enter_and_loops_that_do_not_leave() {
        let loops = [back(&[44, 46, 50, 52, 48], 0.0), back(&[58], 8.0)].concat();
        solved(
            &loops,
            &[true, true, true, true, false, false],
            |_, result| {
                assert_eq!(result.on, [true, true, true, true, true, false]);
            },
        );
        // One of eight that are believed together.
        let loops = [back(&[44, 45, 46, 48, 49, 50, 51], 0.0), back(&[47], 0.7)].concat();
        solved(&loops, &[true; 8], |_, result| {
            assert_eq!(result.on, [true, true, true, true, true, true, true, false]);
        });
    }

    #[test]
    fn a_false_cluster_that_came_first_gives_way_to_more_true_loops() {
        let loops = [back(&[44, 45], 4.0), back(&[47, 50, 53, 56], 0.0)].concat();
        let first = [true, true, false, false, false, false];
        solved(&loops, &first, |problem, result| {
            assert_eq!(result.on, first, "only a trial can tell");
            let clusters = [vec![0, 1], vec![2, 3, 4, 5]];
            let reinstated = problem.reinstate(&clusters, result.clone()).unwrap();
            assert_eq!(reinstated.on, first.map(|on| !on));
            assert!(reinstated.cost < result.cost);
            assert!(problem.deviance(&reinstated) < problem.deviance(&result));
            // The false ones in turn are tried in vain.
            let again = problem.reinstate(&clusters, reinstated.clone()).unwrap();
            assert_eq!(again.on, reinstated.on);
        });
    }
}
