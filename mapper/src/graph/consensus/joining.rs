//! Which loops may join parts of the drive whose odometry is separate.
//!
//! Within a part odometry contradicts a false loop; between parts only other loops do. Two parts are joined where more
//! than half of the loops between them say the same; else all of them are left out.

use super::super::components::components;
use super::super::edge::Edge;
use super::groups::{Chain, GATE};
use std::collections::BTreeMap;

/// Loops of a pair of parts that are asked whom they agree with: of a majority's loops some are among so many.
const SPEAKERS_MAX: usize = 25;

/// What a loop may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// Be believed once its nodes are known from each other.
    Heard,
    /// Join two parts as well.
    Joins,
    /// Nothing.
    LeftOut,
}

/// The standing of every loop; loops are in order of arrival.
pub(super) fn standings(
    nodes: usize,
    odometry: &[Edge],
    chain: &Chain<'_>,
    loops: &[Edge],
) -> Vec<Standing> {
    let part = components(nodes, odometry.iter().map(|edge| (edge.from, edge.to)));
    let mut bridges: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (l, edge) in loops.iter().enumerate() {
        let parts = (part[edge.from], part[edge.to]);
        if parts.0 != parts.1 {
            bridges.entry(parts).or_default().push(l);
        }
    }
    let mut standings = vec![Standing::Heard; loops.len()];
    for bridge in bridges.values() {
        let majority = majority(chain, loops, bridge);
        let others = match majority {
            Some(_) => Standing::Heard,
            None => Standing::LeftOut,
        };
        bridge.iter().for_each(|l| standings[*l] = others);
        for l in majority.unwrap_or_default() {
            standings[l] = Standing::Joins;
        }
    }
    standings
}

/// The loops of a bridge that agree with one of them, where they are more than half.
fn majority(chain: &Chain<'_>, loops: &[Edge], bridge: &[usize]) -> Option<Vec<usize>> {
    let mut speakers = bridge
        .iter()
        .step_by(bridge.len().div_ceil(SPEAKERS_MAX).max(1));
    speakers.find_map(|speaker| {
        let agrees = |l: &usize| {
            let cycle = chain.cycle(&loops[*speaker], &loops[*l]);
            l == speaker || cycle.is_some_and(|chi2| chi2 <= GATE)
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

    /// Two laps whose odometry breaks off between them, with loops from one to the other as they were or turned.
    fn standings_of(turned: impl Iterator<Item = (usize, f64)>) -> Vec<Standing> {
        let graph = drifting(79);
        let odometry: Vec<Edge> = graph
            .odometry()
            .iter()
            .filter(|edge| edge.to != 40)
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
        standings(80, &odometry, &Chain::new(80, &odometry), &loops)
    }

    #[test]
    fn loops_that_agree_join() {
        let found = standings_of((0..5).map(|k| (7 * k, 0.0)));
        assert_eq!(found, [Standing::Joins; 5]);
        assert_eq!(standings_of([(3, 0.0)].into_iter()), [Standing::Joins]);
    }

    #[test]
    fn one_that_contradicts_a_majority_is_heard_only() {
        let found = standings_of((0..5).map(|k| (7 * k, if k == 0 { 2.0 } else { 0.0 })));
        assert_eq!(found[0], Standing::Heard);
        assert_eq!(found[1..], [Standing::Joins; 4]);
    }

    #[test]
    fn loops_that_contradict_each_other_are_left_out() {
        let found = standings_of((0..6).map(|k| (5 * k, 1.0 * k as f64)));
        assert_eq!(found, [Standing::LeftOut; 6]);
        // Nor does one of two opinions win by coming first.
        let found = standings_of((0..6).map(|k| (5 * k, if k < 3 { 2.0 } else { 0.0 })));
        assert_eq!(found, [Standing::LeftOut; 6]);
    }
}
