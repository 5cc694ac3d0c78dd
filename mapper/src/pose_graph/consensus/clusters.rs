//! Loops that agree on the same two stretches of the drive.

use super::super::Edge;
use super::uncertain::Uncertain;
use crate::index::KeyframeIdx;

/// Nodes to both sides within which two loops are of the same spot: a radar's reach in keyframes.
pub(super) const NEAR_NODES: usize = 10;
/// chi2 of three degrees of freedom that 1 in 1,000 exceeds, as for a candidate
/// (`verification/gates.rs`).
pub(super) const GATE: f64 = 16.3;
/// Median of chi2 with three degrees of freedom.
const MEDIAN: f64 = 2.366;
/// Pairs of loops that the claimed covariances are worth when the noise is learned from the data.
const CLAIM_PAIRS: f64 = 5.0;
/// The noise may be three times what the edges claim; beyond, most loops are false and no measure
/// of the noise.
const NOISE_MAX: f64 = 9.0;

/// Odometry by the node that it leads to; of several edges the one from nearest.
pub(super) struct OdometryChain<'a>(Vec<Option<&'a Edge>>);

impl<'a> OdometryChain<'a> {
    pub fn new(nodes: usize, odometry: &'a [Edge]) -> Self {
        let mut steps: Vec<Option<&Edge>> = vec![None; nodes];
        for edge in odometry.iter().filter(|edge| edge.from < edge.to) {
            let step = &mut steps[edge.to.0];
            if step.is_none_or(|other| other.from < edge.from) {
                *step = Some(edge);
            }
        }
        Self(steps)
    }

    /// The step that leads to a node.
    pub fn step(&self, node: usize) -> Option<&'a Edge> {
        self.0.get(node).copied().flatten()
    }

    /// `to` seen from `from`, if odometry connects them.
    fn between(&self, from: KeyframeIdx, to: KeyframeIdx) -> Option<Uncertain> {
        let (low, high) = (from.min(to), from.max(to));
        let mut at = high;
        let mut way = Uncertain::NOWHERE;
        while at > low {
            let step = self.0[at.0]?;
            way = Uncertain::from_edge(step)?.compose(&way);
            at = step.from;
        }
        (at == low).then(|| if from <= to { way } else { way.inverse() })
    }

    /// chi2 of two loops around the cycle that they make with odometry, if it connects them.
    pub fn cycle(&self, a: &Edge, b: &Edge) -> Option<f64> {
        let predicted = self
            .between(b.from, a.from)?
            .compose(&Uncertain::from_edge(a)?)
            .compose(&self.between(a.to, b.to)?);
        Some(predicted.innovation(b).chi2)
    }
}

/// Indices of the loops in each cluster, in order of arrival, and the variance of their errors
/// relative to what the edges claim. Loops go from the earlier node to the later one and come in
/// the order of the later.
pub(super) fn clusters(chain: &OdometryChain<'_>, loops: &[Edge]) -> (Vec<Vec<usize>>, f64) {
    // For every loop the loops before it that are near, with the chi2 of the cycle.
    let near: Vec<Vec<(usize, f64)>> = (0..loops.len())
        .map(|b| {
            let before = (0..b).rev();
            let near = before.take_while(|a| loops[*a].to.0 + NEAR_NODES >= loops[b].to.0);
            near.filter(|a| loops[*a].from.0.abs_diff(loops[b].from.0) <= NEAR_NODES)
                .filter_map(|a| Some((a, chain.cycle(&loops[a], &loops[b])?)))
                .collect()
        })
        .collect();
    let gate = GATE * noise(loops, &near);
    let mut cluster_of: Vec<usize> = Vec::with_capacity(loops.len());
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for (b, near) in near.iter().enumerate() {
        let neighbour = near.iter().find(|(a, chi2)| {
            let first = clusters[cluster_of[*a]].first().map_or(b, |first| *first);
            *chi2 < gate && loops[first].to.0 + NEAR_NODES >= loops[b].to.0
        });
        let cluster = neighbour.map_or(clusters.len(), |(a, _)| cluster_of[*a]);
        if cluster == clusters.len() {
            clusters.push(Vec::new());
        }
        clusters[cluster].push(b);
        cluster_of.push(cluster);
    }
    clusters.sort_by_key(|cluster| cluster.last().copied());
    (clusters, gate / GATE)
}

/// Variance of short cycles relative to what the edges claim, by the median cycle of every loop
/// with its nearest neighbour: false loops are the tail that a median ignores.
fn noise(loops: &[Edge], near: &[Vec<(usize, f64)>]) -> f64 {
    let nearest = near.iter().enumerate().filter_map(|(b, near)| {
        let apart = |(a, _): &&(usize, f64)| {
            loops[*a].from.0.abs_diff(loops[b].from.0) + loops[*a].to.0.abs_diff(loops[b].to.0)
        };
        Some(near.iter().min_by_key(apart)?.1)
    });
    let mut cycles: Vec<f64> = nearest.collect();
    cycles.sort_by(f64::total_cmp);
    let median = cycles.get(cycles.len() / 2).copied().unwrap_or(MEDIAN) / MEDIAN;
    let count = cycles.len() as f64;
    ((median * count + CLAIM_PAIRS) / (count + CLAIM_PAIRS)).min(NOISE_MAX)
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{add_intra_submap_constraints, drifting, edge, square};
    use super::*;
    use randt_geometry::Pose2;

    /// A loop one lap back, wrong by this many metres.
    fn back(to: usize, x_m: f64) -> Edge {
        let measured = square(to - 40).between(&square(to));
        edge(to - 40, to, measured.compose(&Pose2::new(x_m, 0.0, 0.0)))
    }

    fn clustered(loops: &[Edge]) -> (Vec<Vec<usize>>, f64) {
        let mut graph = drifting(100);
        add_intra_submap_constraints(&mut graph);
        clusters(&OdometryChain::new(101, graph.odometry()), loops)
    }

    #[test]
    fn loops_that_say_the_same_nearby_are_a_group() {
        let loops = [
            back(50, 0.0),
            back(53, 0.02),
            back(56, -0.02),
            back(80, 0.0),
        ];
        let (clusters, noise) = clustered(&loops);
        assert_eq!(clusters, [vec![0, 1, 2], vec![3]]);
        assert!(noise > 0.1 && noise < 2.0, "{noise}");
    }

    #[test]
    fn one_that_says_something_else_is_by_itself() {
        let loops = [back(50, 0.0), back(53, 3.0), back(56, 0.0), back(58, 3.0)];
        assert_eq!(clustered(&loops).0, [vec![0, 2], vec![1, 3]]);
    }

    #[test]
    fn a_chain_goes_step_by_step_whatever_else_leads_to_a_node() {
        let mut graph = drifting(100);
        add_intra_submap_constraints(&mut graph);
        let mut odometry = graph.odometry().to_vec();
        odometry.reverse();
        let chain = OdometryChain::new(101, &odometry);
        assert!((1..=100).all(|node| chain.step(node).is_some_and(|step| step.from.0 + 1 == node)));
        assert!(chain.step(0).is_none());
        // Backwards is the inverse of forwards.
        let between = |from, to| chain.between(KeyframeIdx(from), KeyframeIdx(to));
        let (there, back) = (between(3, 9).unwrap(), between(9, 3).unwrap());
        let around = there.compose(&back).pose;
        assert!(around.translation().norm() < 1e-12 && around.yaw_rad.abs() < 1e-12);
    }

    #[test]
    fn odometry_that_breaks_off_leads_nowhere() {
        let graph = drifting(20);
        let odometry: Vec<Edge> = graph
            .odometry()
            .iter()
            .filter(|edge| edge.to.0 != 8)
            .cloned()
            .collect();
        let chain = OdometryChain::new(21, &odometry);
        let between = |from, to| chain.between(KeyframeIdx(from), KeyframeIdx(to));
        assert!(between(5, 10).is_none());
        assert!(between(9, 20).is_some());
    }
}
