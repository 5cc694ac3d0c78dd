//! The verdict's appeal: groups that were turned away are tried against those that stand.
//!
//! A false group that came first, where nothing contradicted it yet, turns the true ones away that come after. What
//! the whole drive says of either is the truncated least squares: odometry's chi2, and for every loop its own, at
//! most the gate's.

use super::super::Error;
use super::super::edge::Edge;
use super::super::loss::Loss;
use super::super::solver::{Effort, Term, solve};
use super::super::system::System;
use super::groups::GATE;
use randt_geometry::{Pose2, elementary::ln};

/// For the estimate to bend to a group that is heard, and to settle with it; only the sum of squares counts.
const EFFORT: Effort = Effort {
    step: 1e-3,
    factorisations_max: 12,
};
/// Degrees of freedom of a loop.
const DOF: f64 = 3.0;
/// Groups heard in one re-check, largest first; the next re-check hears the others.
const HEARINGS_MAX: usize = 12;
/// Rounds in which loops join and leave at the optimum until none does.
const ROUNDS_MAX: usize = 8;

/// An estimate with the loops that it believes.
#[derive(Clone)]
pub(super) struct Verdict {
    pub poses: Vec<Pose2>,
    pub on: Vec<bool>,
    /// The truncated sum of squares.
    pub cost: f64,
}

/// What is judged.
pub(super) struct Case<'a> {
    pub odometry: &'a [Edge],
    pub loops: &'a [Edge],
    /// chi2 beyond which a loop is false.
    pub gate: f64,
}

impl Case<'_> {
    /// Hears the groups that do not agree.
    pub fn appeal(&self, groups: &[Vec<usize>], mut verdict: Verdict) -> Result<Verdict, Error> {
        let mut heard: Vec<&Vec<usize>> = groups.iter().filter(|group| group.len() > 1).collect();
        heard.retain(|group| group.iter().all(|l| !verdict.on[*l]));
        heard.sort_by_key(|group| std::cmp::Reverse(group.len()));
        for group in heard.into_iter().take(HEARINGS_MAX) {
            if group.iter().any(|l| verdict.on[*l]) {
                continue;
            }
            if let Some(better) = self.hear(group, &verdict)? {
                verdict = better;
            }
        }
        Ok(verdict)
    }

    /// Believes a group in full and doubts every other loop; a verdict where the whole fits better so.
    fn hear(&self, group: &[usize], verdict: &Verdict) -> Result<Option<Verdict>, Error> {
        let mut poses = verdict.poses.clone();
        let heard = group.iter().map(|l| (&self.loops[*l], Loss::QUADRATIC));
        let doubted = Loss::Scaled { phi: self.gate };
        let others = self.loops.iter().zip(&verdict.on).filter(|(_, on)| **on);
        let terms: Vec<Term<'_>> = (self.odometry.iter().map(|edge| (edge, Loss::QUADRATIC)))
            .chain(others.map(|(edge, _)| (edge, doubted)))
            .chain(heard)
            .collect();
        solve(&mut None, &mut poses, &terms, EFFORT)?;
        // Settling gains little more than the group itself: what is far worse already need not be settled.
        if self.cost(&poses) > verdict.cost + self.gate * group.len() as f64 {
            return Ok(None);
        }
        let on = self.agreeing(&poses);
        let settled = self.settle(poses, on)?;
        let won = settled.cost < verdict.cost && group.iter().any(|l| settled.on[*l]);
        Ok(won.then_some(settled))
    }

    /// Optimises over the loops that are on; those that agree then join, those that do not leave.
    pub fn settle(&self, mut poses: Vec<Pose2>, mut on: Vec<bool>) -> Result<Verdict, Error> {
        let mut system: Option<System> = None;
        for round in 1.. {
            self.optimise(&mut system, &mut poses, &on)?;
            let agreeing = self.agreeing(&poses);
            if agreeing == on || round > ROUNDS_MAX {
                break;
            }
            on = agreeing;
        }
        let cost = self.cost(&poses);
        Ok(Verdict { poses, on, cost })
    }

    /// Minus twice the log likelihood, but for a constant, with the variance that fits the loops that are on; what is
    /// off is an outlier, whose price does not depend on that variance.
    pub fn surprise(&self, verdict: &Verdict) -> f64 {
        let off = verdict.on.iter().filter(|on| !**on).count() as f64;
        let freedom = DOF * (verdict.on.len() as f64 - off + 1.0);
        let square = verdict.cost - self.gate * off;
        freedom * ln((square + DOF) / freedom) + GATE * off
    }

    /// The truncated sum of squares.
    fn cost(&self, poses: &[Pose2]) -> f64 {
        let loops = self
            .loops
            .iter()
            .map(|edge| chi2(edge, poses).min(self.gate));
        self.odometry
            .iter()
            .map(|edge| chi2(edge, poses))
            .sum::<f64>()
            + loops.sum::<f64>()
    }

    fn optimise(
        &self,
        system: &mut Option<System>,
        poses: &mut [Pose2],
        on: &[bool],
    ) -> Result<(), Error> {
        let believed = self.loops.iter().zip(on).filter(|(_, on)| **on);
        let terms: Vec<Term<'_>> = (self.odometry.iter())
            .chain(believed.map(|(edge, _)| edge))
            .map(|edge| (edge, Loss::QUADRATIC))
            .collect();
        solve(system, poses, &terms, EFFORT).map(|_| ())
    }

    fn agreeing(&self, poses: &[Pose2]) -> Vec<bool> {
        self.loops
            .iter()
            .map(|edge| chi2(edge, poses) <= self.gate)
            .collect()
    }
}

fn chi2(edge: &Edge, poses: &[Pose2]) -> f64 {
    edge.chi2(&poses[edge.from], &poses[edge.to])
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{drifting, edge, square};
    use super::*;

    /// One lap back at these steps, wrong by so many metres.
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

    fn settled(loops: &[Edge], on: &[bool], check: impl Fn(&Case<'_>, Verdict)) {
        let graph = drifting(60);
        let case = Case {
            odometry: graph.odometry(),
            loops,
            gate: GATE,
        };
        let verdict = case.settle(graph.poses().to_vec(), on.to_vec()).unwrap();
        check(&case, verdict);
    }

    #[test]
    fn those_that_agree_join_and_those_that_do_not_leave() {
        let loops = [back(&[44, 46, 50, 52, 48], 0.0), back(&[58], 8.0)].concat();
        settled(
            &loops,
            &[true, true, true, true, false, false],
            |_, verdict| {
                assert_eq!(verdict.on, [true, true, true, true, true, false]);
            },
        );
        // One of eight that are believed together.
        let loops = [back(&[44, 45, 46, 48, 49, 50, 51], 0.0), back(&[47], 0.7)].concat();
        settled(&loops, &[true; 8], |_, verdict| {
            assert_eq!(
                verdict.on,
                [true, true, true, true, true, true, true, false]
            );
        });
    }

    #[test]
    fn a_false_group_that_came_first_loses_its_appeal_against_more_true_ones() {
        let loops = [back(&[44, 45], 4.0), back(&[47, 50, 53, 56], 0.0)].concat();
        let first = [true, true, false, false, false, false];
        settled(&loops, &first, |case, verdict| {
            assert_eq!(verdict.on, first, "nothing but an appeal can tell");
            let groups = [vec![0, 1], vec![2, 3, 4, 5]];
            let heard = case.appeal(&groups, verdict.clone()).unwrap();
            assert_eq!(heard.on, first.map(|on| !on));
            assert!(heard.cost < verdict.cost);
            assert!(case.surprise(&heard) < case.surprise(&verdict));
            // The false ones in turn are heard in vain.
            let again = case.appeal(&groups, heard.clone()).unwrap();
            assert_eq!(again.on, heard.on);
        });
    }
}
