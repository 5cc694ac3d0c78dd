//! Which loops may connect components of the drive whose odometry is separate.
//!
//! Within a component odometry contradicts a false loop; between components only other loops do.
//! Two components are connected where more than half of the loops between them agree; else all of
//! them are excluded.

use super::super::components::components;
use super::super::edge::Edge;
use super::clusters::{GATE, OdometryChain};
use std::collections::BTreeMap;

/// Loops of a pair of components that all others are compared with: of a majority's loops some are
/// among these.
const REPRESENTATIVES_MAX: usize = 25;

/// What a loop may do in the consensus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Membership {
    /// Be believed once its nodes are known from each other.
    Admitted,
    /// Connect two components as well.
    Connects,
    /// Nothing.
    Excluded,
}

/// The membership of every loop; loops are in order of arrival.
pub(super) fn memberships(
    nodes: usize,
    odometry: &[Edge],
    chain: &OdometryChain<'_>,
    loops: &[Edge],
) -> Vec<Membership> {
    let component = components(nodes, odometry.iter().map(|edge| (edge.from.0, edge.to.0)));
    let mut bridges: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (l, edge) in loops.iter().enumerate() {
        let ends = (component[edge.from.0], component[edge.to.0]);
        if ends.0 != ends.1 {
            bridges.entry(ends).or_default().push(l);
        }
    }
    let mut memberships = vec![Membership::Admitted; loops.len()];
    for bridge in bridges.values() {
        let majority = majority(chain, loops, bridge);
        let others = match majority {
            Some(_) => Membership::Admitted,
            None => Membership::Excluded,
        };
        bridge.iter().for_each(|l| memberships[*l] = others);
        for l in majority.unwrap_or_default() {
            memberships[l] = Membership::Connects;
        }
    }
    memberships
}

/// The loops of a bridge that agree with one of them, where they are more than half.
fn majority(chain: &OdometryChain<'_>, loops: &[Edge], bridge: &[usize]) -> Option<Vec<usize>> {
    let step = bridge.len().div_ceil(REPRESENTATIVES_MAX).max(1);
    let mut representatives = bridge.iter().step_by(step);
    representatives.find_map(|representative| {
        let agrees = |l: &usize| {
            let cycle = chain.cycle(&loops[*representative], &loops[*l]);
            l == representative || cycle.is_some_and(|chi2| chi2 <= GATE)
        };
        let agreeing: Vec<usize> = bridge.iter().copied().filter(agrees).collect();
        (2 * agreeing.len() > bridge.len()).then_some(agreeing)
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{drifting, edge, square};
    use super::*;
    use randt_geometry::Pose2;

    /// Two laps whose odometry breaks off between them, with loops from one to the other as they
    /// were or turned.
    fn memberships_of(turned: impl Iterator<Item = (usize, f64)>) -> Vec<Membership> {
        let graph = drifting(79);
        let odometry: Vec<Edge> = graph
            .odometry()
            .iter()
            .filter(|edge| edge.to.0 != 40)
            .cloned()
            .collect();
        let loops: Vec<Edge> = turned
            .map(|(step, yaw_rad)| {
                let measured = square(step).between(&square(step + 40));
                edge(
                    step,
                    step + 40,
                    measured.compose(&Pose2::new(0.0, 0.0, yaw_rad)),
                )
            })
            .collect();
        memberships(80, &odometry, &OdometryChain::new(80, &odometry), &loops)
    }

    #[test]
    fn loops_that_agree_connect() {
        let found = memberships_of((0..5).map(|k| (7 * k, 0.0)));
        assert_eq!(found, [Membership::Connects; 5]);
        assert_eq!(
            memberships_of([(3, 0.0)].into_iter()),
            [Membership::Connects]
        );
    }

    #[test]
    fn a_loop_that_contradicts_a_majority_is_only_admitted() {
        let found = memberships_of((0..5).map(|k| (7 * k, if k == 0 { 2.0 } else { 0.0 })));
        assert_eq!(found[0], Membership::Admitted);
        assert_eq!(found[1..], [Membership::Connects; 4]);
    }

    #[test]
    fn loops_that_contradict_each_other_are_excluded() {
        let found = memberships_of((0..6).map(|k| (5 * k, 1.0 * k as f64)));
        assert_eq!(found, [Membership::Excluded; 6]);
        // Nor does one of two opinions win by coming first.
        let found = memberships_of((0..6).map(|k| (5 * k, if k < 3 { 2.0 } else { 0.0 })));
        assert_eq!(found, [Membership::Excluded; 6]);
    }
}
