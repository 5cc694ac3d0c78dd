//! Nodes that are marginalized: no unknowns any more, each stands on a node that is one.

use super::super::consensus::Uncertain;
use super::super::{Edge, Error};
use super::{LoopId, PoseGraph};
use crate::index::KeyframeIdx;
use randt_geometry::Pose2;

/// Where a marginalized node stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// A node that is an unknown.
    pub to: KeyframeIdx,
    /// The marginalized node seen from there.
    pub pose: Pose2,
}

impl PoseGraph {
    /// Takes a node out of the equations; from now on it stands on another one as it does now.
    /// Gives the names of the loops that go with it.
    ///
    /// The odometry that leads to it and from it becomes one edge, the exact marginal of these
    /// two. What else is known of it, loops and intra-submap constraints, is dropped: less is
    /// known than was measured, never more. It must lie between two nodes of its odometry.
    pub fn marginalize(
        &mut self,
        node: KeyframeIdx,
        to: KeyframeIdx,
    ) -> Result<Vec<LoopId>, Error> {
        let between = self.odometry_through(node);
        let is_unknown = |it: KeyframeIdx| self.is_unknown(it);
        let is_held = |it: &Option<Attachment>| it.is_some_and(|it| it.to == node);
        let is_free = node != to && is_unknown(node) && !self.attachments.iter().any(is_held);
        let is_near = is_unknown(to) && self.component.get(node.0) == self.component.get(to.0);
        let Some(((_, from), bridge)) = between.filter(|_| is_free && is_near) else {
            return Err(Error::NotBetween(node.0));
        };
        self.moved();
        if let Some(edge) = self.odometry.get_mut(from) {
            *edge = bridge;
        }
        let leads = |edge: &Edge| edge.from == node || edge.to == node;
        self.odometry.retain(|edge| !leads(edge));
        let loops = self.loops.iter().filter(|l| leads(&l.edge));
        let dropped = loops.map(|l| l.id).collect();
        self.loops.retain(|l| !leads(&l.edge));
        let pose = self.poses[to.0].between(&self.poses[node.0]);
        self.attachments[node.0] = Some(Attachment { to, pose });
        self.label();
        Ok(dropped)
    }

    /// Puts a marginalized node elsewhere, as it is seen from what it stands on.
    pub(crate) fn stand_at(&mut self, node: KeyframeIdx, pose: Pose2) {
        if let Some(attachment) = self.attachments.get_mut(node.0).and_then(Option::as_mut) {
            attachment.pose = pose;
            self.poses[node.0] = self.poses[attachment.to.0].compose(&pose);
        }
    }

    /// Whether a node is an unknown of the equations.
    pub fn is_unknown(&self, node: KeyframeIdx) -> bool {
        self.attachments.get(node.0).is_some_and(Option::is_none)
    }

    /// For every node where it stands; `None` for those that are unknowns.
    pub(crate) fn attachments(&self) -> &[Option<Attachment>] {
        &self.attachments
    }

    /// Odometry's edges to a node and from it, and both as one.
    fn odometry_through(&self, node: KeyframeIdx) -> Option<((usize, usize), Edge)> {
        let edges = || self.odometry.iter().enumerate();
        // Of several the nearest neighbour's: the others are intra-submap constraints.
        let (to, before) = edges()
            .filter(|(_, edge)| edge.to == node && edge.from < node)
            .min_by_key(|(_, edge)| core::cmp::Reverse(edge.from))?;
        let (from, after) = edges()
            .filter(|(_, edge)| edge.from == node && edge.to > node)
            .min_by_key(|(_, edge)| edge.to)?;
        let bridge = Uncertain::from_edge(before)?.compose(&Uncertain::from_edge(after)?);
        let information = bridge.covariance.cholesky()?.inverse();
        let bridge = Edge {
            from: before.from,
            to: after.to,
            measured: bridge.pose,
            information: (information + information.transpose()) * 0.5,
        };
        Some(((to, from), bridge))
    }

    /// Puts the marginalized nodes where they stand.
    pub(super) fn carry_attached(&mut self) {
        for (node, attachment) in self.attachments.iter().enumerate() {
            if let Some(Attachment { to, pose }) = attachment {
                self.poses[node] = self.poses[to.0].compose(pose);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{add_intra_submap_constraints, close, drifting, edge};
    use super::*;

    /// Laps of 40 nodes, solved.
    fn laps(nodes: usize) -> PoseGraph {
        let mut graph = drifting(nodes);
        add_intra_submap_constraints(&mut graph);
        close(&mut graph, 3);
        graph.optimise_trusting().unwrap();
        graph
    }

    fn marginalize(graph: &mut PoseGraph, nodes: impl Iterator<Item = usize>) {
        for node in nodes {
            let to = KeyframeIdx(node % 40);
            graph.marginalize(KeyframeIdx(node), to).unwrap();
        }
    }

    #[test]
    fn a_chain_is_marginalized_exactly() {
        let mut graph = drifting(30);
        graph.optimise().unwrap();
        let covariance = |graph: &mut PoseGraph, i, j| {
            let found = graph.relative_covariance(KeyframeIdx(i), KeyframeIdx(j));
            found.unwrap()
        };
        let pairs = [(0, 30), (4, 12), (11, 21), (12, 4)];
        let before = pairs.map(|(i, j)| covariance(&mut graph, i, j));
        for node in (5..11).chain(13..20).rev() {
            let to = KeyframeIdx(2);
            graph.marginalize(KeyframeIdx(node), to).unwrap();
        }
        for ((i, j), before) in pairs.into_iter().zip(before) {
            let after = covariance(&mut graph, i, j);
            assert!((after - before).amax() < 1e-9 * before.amax(), "{i} {j}");
        }
        assert_eq!(graph.odometry().len(), 30 - 13);
        assert!(
            graph
                .relative_covariance(KeyframeIdx(6), KeyframeIdx(30))
                .is_err()
        );
    }

    #[test]
    fn no_pair_is_surer_than_all_measurements_together_make_it() {
        let (mut all, mut thinned) = (laps(240), laps(240));
        marginalize(&mut thinned, 83..220);
        thinned.optimise_trusting().unwrap();
        let kept: Vec<usize> = (0..83).chain(220..240).collect();
        for n in 0..20 {
            let [i, j] = [n * 37 % kept.len(), n * 61 % kept.len() + 1]
                .map(|at| KeyframeIdx(kept[at % kept.len()]));
            let exact = all.relative_covariance(i, j).unwrap();
            let found = thinned.relative_covariance(i, j).unwrap();
            // Whitened by the exact one: in every direction.
            let lower = exact.cholesky().unwrap().l().try_inverse().unwrap();
            let least = (lower * found * lower.transpose())
                .symmetric_eigenvalues()
                .min();
            println!("{} {}: {least:.3}", i.0, j.0);
            assert!(least > 0.95, "{i:?} {j:?}: {least}");
        }
    }

    #[test]
    fn marginalized_nodes_go_with_what_they_stand_on() {
        let mut graph = laps(240);
        marginalize(&mut graph, 83..220);
        assert_eq!(graph.loops().len(), 15);
        let seen = |graph: &PoseGraph| graph.poses()[33].between(&graph.poses()[153]);
        let (before, moved_from) = (seen(&graph), graph.poses()[153]);
        // A loop that says something else.
        let mut other = edge(2, 34, graph.poses()[2].between(&graph.poses()[34]));
        other.measured = other.measured.compose(&Pose2::new(0.5, 0.0, 0.0));
        other.information *= 100.0;
        graph.add_loop(other).unwrap();
        graph.optimise_trusting().unwrap();
        let after = seen(&graph);
        assert!((after.translation() - before.translation()).norm() < 1e-12);
        let moved_m = (graph.poses()[153].translation() - moved_from.translation()).norm();
        assert!(moved_m > 0.01, "{moved_m}");
        assert_eq!(
            graph.component_of(KeyframeIdx(153)),
            graph.component_of(KeyframeIdx(0))
        );
        // The whole is judged anew over what is left.
        assert!(graph.recheck().is_ok());
        assert!((seen(&graph).translation() - before.translation()).norm() < 1e-12);
    }

    #[test]
    fn what_cannot_be_marginalized_is_refused() {
        let mut graph = laps(90);
        let mut refused = |node, to| {
            graph
                .marginalize(KeyframeIdx(node), KeyframeIdx(to))
                .is_err()
        };
        // Its component's first one, the last one, one that is not there, on itself.
        assert!(refused(0, 5) && refused(90, 5) && refused(91, 5) && refused(50, 50));
        assert!(!refused(50, 10));
        assert!(refused(50, 11) && refused(60, 50), "gone already");
        assert!(refused(10, 11), "another one stands on it");
        let leads_there = edge(50, 70, Pose2::IDENTITY);
        assert_eq!(
            graph.add_loop(leads_there.clone()),
            Err(Error::Marginalized(50))
        );
        assert_eq!(
            graph.add_odometry(leads_there),
            Err(Error::Marginalized(50))
        );
    }
}
