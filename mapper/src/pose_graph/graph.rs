//! Nodes, odometry, loops, and the estimate.

mod covariances;
mod loop_edge;
mod marginals;

pub use covariances::Marginals;
use loop_edge::LOOP_LOSS;
pub use loop_edge::{Loop, LoopId};
pub use marginals::Attachment;

use super::Error;
use super::components::components;
use super::consensus::{self, Recheck};
use super::edge::{Edge, check_pose};
use super::loss::Loss;
use super::solver::{Effort, Report, Term, solve, solve_anew};
use super::system::System;
use super::tail::Tail;
use crate::index::{ComponentIdx, KeyframeIdx};
use randt_geometry::Pose2;

/// A pose graph with its estimate.
///
/// Odometry is trusted. Loops are weighed by their chi2, and [`PoseGraph::recheck`] switches off
/// those that contradict the rest. Every connected component keeps the pose of its lowest node.
#[derive(Default)]
pub struct PoseGraph {
    poses: Vec<Pose2>,
    odometry: Vec<Edge>,
    loops: Vec<Loop>,
    /// The name that the next loop will have.
    pub(super) next_loop: u64,
    /// For every node the lowest one of its component.
    component: Vec<ComponentIdx>,
    /// For every node where it stands, if it is no unknown.
    attachments: Vec<Option<Attachment>>,
    system: Option<System>,
    /// What odometry has added to the equations since they were factorised at the poses as they
    /// are; `None` where they are to be factorised first.
    tail: Option<Tail>,
}

impl PoseGraph {
    /// The graph that had these poses, edges and loops; later loops are named from `next_loop` on.
    pub fn restore(
        poses: Vec<Pose2>,
        attachments: Vec<Option<Attachment>>,
        odometry: Vec<Edge>,
        loops: Vec<Loop>,
        next_loop: u64,
    ) -> Result<Self, Error> {
        poses.iter().try_for_each(check_pose)?;
        let mut graph = Self {
            poses,
            attachments,
            odometry,
            loops,
            next_loop,
            ..Self::default()
        };
        graph.attachments.resize(graph.poses.len(), None);
        graph.check()?;
        graph.label();
        Ok(graph)
    }

    /// Refuses edges that no graph has, and names of loops that do not rise.
    fn check(&self) -> Result<(), Error> {
        let loops = &self.loops;
        let mut edges = self.odometry.iter().chain(loops.iter().map(|l| &l.edge));
        edges.try_for_each(|edge| self.check_edge(edge, self.poses.len()))?;
        let rises = loops.is_sorted_by(|a, b| a.id < b.id);
        if !rises || loops.last().is_some_and(|l| l.id.0 >= self.next_loop) {
            return Err(Error::LoopNames(self.next_loop));
        }
        let mut attached = self.attachments.iter().flatten();
        match attached.find(|it| !self.is_unknown(it.to)) {
            Some(attached) => Err(Error::Marginalized(attached.to.0)),
            None => Ok(()),
        }
    }

    /// Adds a node where it is believed to be and returns its index. It is a component by itself
    /// until an edge connects it.
    pub fn add_node(&mut self, pose: Pose2) -> Result<KeyframeIdx, Error> {
        check_pose(&pose)?;
        let node = KeyframeIdx(self.poses.len());
        self.tail = None;
        self.poses.push(pose);
        self.component.push(ComponentIdx(node.0));
        self.attachments.push(None);
        Ok(node)
    }

    /// Adds an odometry edge between nodes that are there.
    pub fn add_odometry(&mut self, edge: Edge) -> Result<(), Error> {
        self.check_edge(&edge, self.poses.len())?;
        self.tail = None;
        self.odometry.push(edge);
        self.update_components();
        Ok(())
    }

    /// Adds the node that an odometry edge leads to, where that edge puts it. The edge's `to` is
    /// the next index.
    pub fn append(&mut self, edge: Edge) -> Result<KeyframeIdx, Error> {
        self.check_edge(&edge, self.poses.len() + 1)?;
        let (node, count) = (edge.from.0, self.poses.len());
        let from = self.poses.get(node).ok_or(Error::NoNode { node, count })?;
        let node = self.add_node(from.compose(&edge.measured))?;
        self.add_odometry(Edge { to: node, ..edge })?;
        Ok(node)
    }

    /// Adds a loop between nodes that are there.
    pub fn add_loop(&mut self, edge: Edge) -> Result<LoopId, Error> {
        self.check_edge(&edge, self.poses.len())?;
        self.moved();
        let id = LoopId(self.next_loop);
        self.next_loop += 1;
        let chi2 = edge.chi2(&self.poses);
        self.loops.push(Loop {
            id,
            edge,
            chi2,
            weight: 1.0,
            on: true,
        });
        self.update_components();
        Ok(id)
    }

    /// Takes a loop out and returns its measurement; `None` where there is none of that name.
    pub fn remove_loop(&mut self, id: LoopId) -> Option<Edge> {
        // Names rise, so the list is sorted.
        let at = self.loops.binary_search_by_key(&id, |l| l.id).ok()?;
        self.moved();
        let removed = self.loops.remove(at);
        self.label();
        Some(removed.edge)
    }

    /// Moves all nodes of a component as one body: a point p of it comes to stand at `by` p.
    pub fn move_component(&mut self, component: ComponentIdx, by: &Pose2) {
        self.moved();
        for (pose, own) in self.poses.iter_mut().zip(&self.component) {
            if *own == component {
                *pose = by.compose(pose);
            }
        }
    }

    /// Where every node stands.
    pub fn poses(&self) -> &[Pose2] {
        &self.poses
    }

    /// The odometry edges.
    pub fn odometry(&self) -> &[Edge] {
        &self.odometry
    }

    /// The loops, in the order of their names.
    pub fn loops(&self) -> &[Loop] {
        &self.loops
    }

    /// The lowest node of the component that a node belongs to, over odometry and the loops that
    /// are on.
    pub fn component_of(&self, node: KeyframeIdx) -> Option<ComponentIdx> {
        self.component.get(node.0).copied()
    }

    /// Moves the poses to the optimum over odometry and the loops that are on, starting where they
    /// are.
    pub fn optimise(&mut self) -> Result<Report, Error> {
        self.descend(LOOP_LOSS, |system, poses, terms| {
            solve(system, poses, terms, Effort::FULL)
        })
    }

    /// The same as far as it matters while loops still come.
    pub fn follow(&mut self) -> Result<Report, Error> {
        self.descend(LOOP_LOSS, |system, poses, terms| {
            solve(system, poses, terms, Effort::WARM)
        })
    }

    /// The same with every loop that is on believed in full: the plain least squares, from however
    /// far away. What odometry has wound up is unwound.
    pub fn optimise_trusting(&mut self) -> Result<Report, Error> {
        self.descend(Loss::QUADRATIC, |system, poses, terms| {
            solve_anew(system, poses, terms, Effort::FULL)
        })
    }

    fn descend(
        &mut self,
        loss: Loss,
        solve: impl FnOnce(&mut Option<System>, &mut [Pose2], &[Term<'_>]) -> Result<Report, Error>,
    ) -> Result<Report, Error> {
        let terms: Vec<Term<'_>> = terms(&self.odometry, &self.loops, loss).collect();
        let report = solve(&mut self.system, &mut self.poses, &terms);
        self.moved();
        self.carry_attached();
        let report = report?;
        for l in &mut self.loops {
            l.weigh(&self.poses, loss);
        }
        Ok(report)
    }

    /// Judges all loops anew, those switched off included, and optimises over those that agree.
    pub fn recheck(&mut self) -> Result<Recheck, Error> {
        let edges: Vec<&Edge> = self.loops.iter().map(|l| &l.edge).collect();
        let judged = consensus::judge(&self.poses, &self.odometry, &edges)?;
        self.moved();
        self.poses = judged.poses;
        for (l, on) in self.loops.iter_mut().zip(&judged.on) {
            l.on = *on;
        }
        self.label();
        let report = self.optimise()?;
        Ok(Recheck {
            report,
            on: judged.on.iter().filter(|on| **on).count(),
            off: judged.on.iter().filter(|on| !**on).count(),
            noise: judged.noise,
        })
    }

    /// Refuses edges of numbers that no measurement has, and those that lead to marginalized nodes.
    fn check_edge(&self, edge: &Edge, count: usize) -> Result<(), Error> {
        edge.check(count)?;
        let is_gone = |node: &&KeyframeIdx| node.0 < self.poses.len() && !self.is_unknown(**node);
        match [edge.from, edge.to].iter().find(is_gone) {
            Some(node) => Err(Error::Marginalized(node.0)),
            None => Ok(()),
        }
    }

    /// The equations are no longer those that were factorised.
    fn moved(&mut self) {
        self.tail = None;
        if let Some(system) = &mut self.system {
            system.factorised = false;
        }
    }

    /// Labels the components anew where the newest edge connects two.
    fn update_components(&mut self) {
        let label = |edge: &Edge| self.component[edge.from.0] != self.component[edge.to.0];
        if self.odometry.last().is_some_and(label)
            || self.loops.last().is_some_and(|l| l.on && label(&l.edge))
        {
            self.label();
        }
    }

    fn label(&mut self) {
        let loops = self.loops.iter().filter(|l| l.on).map(|l| &l.edge);
        let edges = self.odometry.iter().chain(loops);
        let components = components(self.poses.len(), edges.map(|e| (e.from.0, e.to.0)));
        self.component = components.into_iter().map(ComponentIdx).collect();
        for (node, attachment) in self.attachments.iter().enumerate() {
            if let Some(attachment) = attachment {
                self.component[node] = self.component[attachment.to.0];
            }
        }
    }
}

/// Odometry, believed in full, and the loops that are on.
fn terms<'a>(
    odometry: &'a [Edge],
    loops: &'a [Loop],
    loss: Loss,
) -> impl Iterator<Item = Term<'a>> {
    let loops = loops.iter().filter(|l| l.on);
    let odometry = odometry.iter().map(|edge| (edge, Loss::QUADRATIC));
    odometry.chain(loops.map(move |l| (&l.edge, loss)))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, drifting, edge, error_m, square};
    use super::loop_edge::LOOP_PHI;
    use super::*;

    #[test]
    fn loops_pull_a_drifting_drive_straight() {
        let mut graph = drifting(120);
        assert!(error_m(&graph) > 5.0);
        close(&mut graph, 3);
        let report = graph.optimise_trusting().unwrap();
        assert!(report.converged && report.iterations < 12, "{report:?}");
        assert!(error_m(&graph) < 1.0, "{}", error_m(&graph));
        // At the optimum a second run finds nothing to do, and believing in full was right.
        let again = graph.optimise().unwrap();
        assert!(again.iterations <= 2 && (again.chi2 - report.chi2).abs() < 1e-9 * report.chi2);
        assert!(
            graph
                .loops()
                .iter()
                .all(|l| l.weight == 1.0 && l.chi2 < LOOP_PHI)
        );
    }

    #[test]
    fn a_false_loop_is_weighed_down() {
        let mut graph = drifting(120);
        close(&mut graph, 3);
        graph.optimise_trusting().unwrap();
        let before = graph.poses().to_vec();
        let id = graph
            .add_loop(edge(5, 105, Pose2::new(1.0, 0.5, 2.0)))
            .unwrap();
        graph.optimise().unwrap();
        let wrong = graph.loops().last().unwrap();
        assert!(wrong.id == id && wrong.weight < 0.01 && wrong.chi2 > 1000.0);
        let moved = before
            .iter()
            .zip(graph.poses())
            .map(|(a, b)| (a.translation() - b.translation()).norm());
        assert!(moved.fold(0.0, f64::max) < 0.1);
        assert_eq!(graph.remove_loop(id).unwrap().to, KeyframeIdx(105));
        assert!(graph.remove_loop(id).is_none());
        graph.optimise().unwrap();
        let moved = before
            .iter()
            .zip(graph.poses())
            .map(|(a, b)| (a.translation() - b.translation()).norm());
        assert!(moved.fold(0.0, f64::max) < 1e-7);
    }

    #[test]
    fn components_that_no_edge_connects_stay_separate() {
        let mut graph = drifting(20);
        let other = graph.add_node(Pose2::new(100.0, 0.0, 1.0)).unwrap();
        let last = graph
            .append(edge(other.0, other.0 + 1, Pose2::new(1.0, 0.0, 0.0)))
            .unwrap();
        assert_eq!(
            (graph.component_of(last), graph.component_of(KeyframeIdx(7))),
            (Some(ComponentIdx(other.0)), Some(ComponentIdx(0)))
        );
        assert_eq!(graph.component_of(KeyframeIdx(last.0 + 1)), None);
        let before = graph.poses().to_vec();
        graph.optimise().unwrap();
        assert_eq!(graph.poses()[other.0], before[other.0]);
        assert!(matches!(
            graph.relative_covariance(KeyframeIdx(3), last),
            Err(Error::NotConnected { .. })
        ));

        // A loop connects them: the later component moves, the earlier stands.
        let id = graph.add_loop(edge(0, other.0, square(0))).unwrap();
        assert_eq!(graph.component_of(last), Some(ComponentIdx(0)));
        graph.optimise_trusting().unwrap();
        assert_eq!(graph.poses()[0], before[0]);
        assert!((graph.poses()[last.0].x_m - 1.0).abs() < 1e-9);
        assert!(graph.relative_covariance(KeyframeIdx(3), last).is_ok());
        graph.remove_loop(id);
        assert_eq!(graph.component_of(last), Some(ComponentIdx(other.0)));
    }

    #[test]
    fn an_empty_graph_and_a_single_node_are_solved() {
        let mut graph = PoseGraph::default();
        assert!(graph.optimise().unwrap().converged);
        graph.add_node(Pose2::IDENTITY).unwrap();
        assert!(graph.optimise().unwrap().converged);
        assert!(graph.recheck().is_ok());
        assert!(graph.add_node(Pose2::new(f64::NAN, 0.0, 0.0)).is_err());
        assert!(graph.append(edge(7, 8, Pose2::IDENTITY)).is_err());
    }

    #[test]
    fn the_same_graph_gives_the_same_bits() {
        let solved = || {
            let mut graph = drifting(200);
            close(&mut graph, 1);
            graph.recheck().unwrap();
            graph.poses().to_vec()
        };
        assert_eq!(solved(), solved());
    }
}
