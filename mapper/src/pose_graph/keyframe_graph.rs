//! The pose graph of the map: a node for every keyframe, constraints of odometry, loop closures.

use super::odometry::{Steps, intra_submap_constraint};
use super::saved::{SavedAttachment, SavedEdge, SavedGraph, SavedLoop, SavedPose, bridged};
use super::{Attachment, Edge, Error, Loop, LoopId, Marginals, PoseGraph, Prior, Report, Visitors};
use crate::index::{ClosureIdx, ComponentIdx, KeyframeIdx};
use crate::keyframe::{KeyframeStore, MapKeyframe};
use crate::verification::LoopClosure;
use nalgebra::Matrix3;
use randt_config::Config;
use randt_geometry::Pose2;

/// Weight below which a loop has proved wrong: the rest of the map disagrees with it.
const WEIGHT_MIN: f64 = 0.3;

/// The graph, and which closure each of its loops is of.
pub(crate) struct KeyframeGraph {
    graph: PoseGraph,
    /// Loops of the graph: name there, index of the closure.
    closures: Vec<(LoopId, ClosureIdx)>,
    visitors: Visitors,
    steps: Steps,
    is_verified: bool,
    /// Optimisations without a result; the estimate stayed where it was.
    pub failures: u64,
}

impl KeyframeGraph {
    /// Empty.
    pub fn new(config: &Config) -> Self {
        Self {
            graph: PoseGraph::default(),
            closures: Vec::new(),
            visitors: Visitors::default(),
            steps: Steps::new(config),
            is_verified: config.loops.verify,
            failures: 0,
        }
    }

    /// Adds the node of a keyframe that comes next; `false` where its numbers are none of a
    /// robot's.
    pub fn append(&mut self, keyframe: &MapKeyframe, keyframes: &KeyframeStore) -> bool {
        let node = match self.steps.to(keyframe, keyframes) {
            Some(edge) => self.graph.append(edge),
            // A frame's own coordinates, until a loop merges it.
            None => self.graph.add_node(keyframe.odom_from_base),
        };
        if node.is_ok()
            && let Some(edge) = intra_submap_constraint(keyframe, keyframes)
        {
            // Both nodes are there and the numbers are good: the step's edge was accepted. A root
            // that was marginalized holds no more keyframes.
            let _ = self.graph.add_odometry(edge);
        }
        node.is_ok()
    }

    /// The constraints of odometry that hold a keyframe that comes next.
    pub fn odometry_constraints(
        &self,
        keyframe: &MapKeyframe,
        keyframes: &KeyframeStore,
    ) -> impl Iterator<Item = Edge> + use<> {
        let step = self.steps.to(keyframe, keyframes);
        step.into_iter()
            .chain(intra_submap_constraint(keyframe, keyframes))
    }

    /// Adds the loop of a closure.
    pub fn add_closure(&mut self, closure: ClosureIdx, edge: Edge) -> Result<(), Error> {
        let id = self.graph.add_loop(edge)?;
        self.closures.push((id, closure));
        Ok(())
    }

    /// Optimises; takes out loops that proved wrong and optimises again. Gives the closures of
    /// those.
    pub fn optimize_and_prune(&mut self) -> Vec<ClosureIdx> {
        self.prune_until_good(PoseGraph::follow)
    }

    fn prune_until_good(
        &mut self,
        optimise: fn(&mut PoseGraph) -> Result<Report, Error>,
    ) -> Vec<ClosureIdx> {
        let mut pruned = Vec::new();
        loop {
            if optimise(&mut self.graph).is_err() {
                self.failures += 1;
                return pruned;
            }
            let before = pruned.len();
            if self.is_verified {
                self.prune(&mut pruned);
            }
            if pruned.len() == before {
                return pruned;
            }
        }
    }

    /// Judges all loops anew, as if the drive were driven again: one that was let in while the map
    /// was uncertain can prove wrong by what came later. Then optimises and prunes.
    pub fn recheck(&mut self) -> Vec<ClosureIdx> {
        let mut pruned = Vec::new();
        if self.is_verified && !self.closures.is_empty() {
            if self.graph.recheck().is_err() {
                self.failures += 1;
            }
            self.prune(&mut pruned);
        }
        pruned.extend(self.prune_until_good(PoseGraph::optimise));
        pruned
    }

    /// Takes out the loops that the graph has switched off.
    fn prune(&mut self, pruned: &mut Vec<ClosureIdx>) {
        let loops = self.graph.loops().iter();
        let wrong = loops.filter(|l| l.weight < WEIGHT_MIN).map(|l| l.id);
        for id in wrong.collect::<Vec<_>>() {
            self.graph.remove_loop(id);
            if let Some(at) = self.closures.iter().position(|(name, _)| *name == id) {
                pruned.push(self.closures.remove(at).1);
            }
        }
    }

    /// Takes a keyframe out of the equations: it stands on another one from now on. Gives the
    /// closures whose loops go with it, or nothing where it cannot.
    pub fn marginalize(
        &mut self,
        keyframe: KeyframeIdx,
        to: KeyframeIdx,
    ) -> Option<Vec<ClosureIdx>> {
        let dropped = self.drop_node(keyframe, to)?;
        self.visitors.push(to, keyframe);
        Some(dropped)
    }

    /// The same with one that has left before and is forgotten, as it stood then: it shows
    /// nothing.
    pub fn marginalize_forgotten(
        &mut self,
        keyframe: KeyframeIdx,
        to: KeyframeIdx,
        pose: Pose2,
    ) -> Option<Vec<ClosureIdx>> {
        let dropped = self.drop_node(keyframe, to)?;
        self.graph.stand_at(keyframe, pose);
        Some(dropped)
    }

    fn drop_node(&mut self, keyframe: KeyframeIdx, to: KeyframeIdx) -> Option<Vec<ClosureIdx>> {
        let dropped = self.graph.marginalize(keyframe, to).ok()?;
        let is_dropped = |(id, _): &mut (LoopId, _)| dropped.contains(id);
        let closures = self.closures.extract_if(.., is_dropped);
        Some(closures.map(|(_, closure)| closure).collect())
    }

    /// Where a keyframe that has left the graph stands.
    pub fn attachment(&self, keyframe: KeyframeIdx) -> Option<Attachment> {
        self.graph.attachments().get(keyframe.0).copied().flatten()
    }

    /// Finds out which keyframes of a graph that was restored passed its nodes last; those whose
    /// observations the journal no longer has are none of them.
    pub fn recall_visitors(&mut self, forgotten: &[KeyframeIdx]) {
        let attached = self.graph.attachments().iter().enumerate();
        let visitor = |(index, attachment): (usize, &Option<Attachment>)| {
            let visitor = KeyframeIdx(index);
            let is_seen = forgotten.binary_search(&visitor).is_err();
            Some(((*attachment)?.to, visitor)).filter(|_| is_seen)
        };
        self.visitors = attached.filter_map(visitor).collect();
    }

    /// Whether a keyframe is an unknown of the equations; else it stands on another one.
    pub fn is_unknown(&self, keyframe: KeyframeIdx) -> bool {
        self.graph.is_unknown(keyframe)
    }

    /// The keyframe that passed a node last: of those that stand on it, or itself.
    pub fn newest_at(&self, node: KeyframeIdx) -> KeyframeIdx {
        self.visitors.newest(node)
    }

    /// Whether the grid shows what a keyframe saw: it was the last one at its node.
    pub fn shows(&self, keyframe: KeyframeIdx) -> bool {
        let node = self.attachment(keyframe).map_or(keyframe, |it| it.to);
        self.newest_at(node) == keyframe
    }

    /// The estimate of `newer` seen from `older`, where they are of one component.
    pub fn prior(&mut self, older: KeyframeIdx, newer: KeyframeIdx) -> Option<Prior> {
        if self.component_of(older) != self.component_of(newer) {
            return None;
        }
        let covariance = match older == newer {
            true => Matrix3::zeros(),
            false => self.graph.relative_covariance(older, newer).ok()?,
        };
        let older_from_newer = self.pose(older)?.between(self.pose(newer)?);
        Some(Prior {
            older_from_newer,
            covariance,
        })
    }

    /// How well all keyframes are known from each other.
    pub fn marginals(&self) -> Option<Marginals<'_>> {
        self.graph.marginals().ok()
    }

    /// Where all keyframes are in the map; poses of different components have nothing in common.
    pub fn poses(&self) -> &[Pose2] {
        self.graph.poses()
    }

    /// Where a keyframe is in the map.
    pub fn pose(&self, keyframe: KeyframeIdx) -> Option<&Pose2> {
        self.graph.poses().get(keyframe.0)
    }

    /// The component that a keyframe belongs to.
    pub fn component_of(&self, keyframe: KeyframeIdx) -> ComponentIdx {
        let component = self.graph.component_of(keyframe);
        component.unwrap_or(ComponentIdx(keyframe.0))
    }

    /// How many keyframes each component has, by its first keyframe; 0 for keyframes that are no
    /// first one.
    fn component_sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0_usize; self.poses().len()];
        for node in 0..sizes.len() {
            if let Some(size) = sizes.get_mut(self.component_of(KeyframeIdx(node)).0) {
                *size += 1;
            }
        }
        sizes
    }

    /// The component with most keyframes, the older one of equals.
    pub fn largest_component(&self) -> ComponentIdx {
        let sizes = self.component_sizes().into_iter().enumerate().rev();
        let largest = sizes.max_by_key(|(_, size)| *size);
        ComponentIdx(largest.map_or(0, |(first, _)| first))
    }

    /// How many components there are.
    pub fn components(&self) -> usize {
        let sizes = self.component_sizes();
        sizes.iter().filter(|size| **size > 0).count()
    }

    /// Moves all keyframes of a component as one body.
    pub fn move_component(&mut self, component: ComponentIdx, by: &Pose2) {
        self.graph.move_component(component, by);
    }

    /// The loops of the graph, in order of their names.
    pub fn loops(&self) -> &[Loop] {
        self.graph.loops()
    }

    /// The constraints of odometry.
    #[cfg(test)]
    pub fn odometry(&self) -> &[Edge] {
        self.graph.odometry()
    }

    /// How often the equations were factorised.
    pub fn factorisations(&self) -> u64 {
        self.graph.factorisations()
    }

    /// What a snapshot has of the graph.
    pub fn saved(&self) -> SavedGraph {
        let loops = self.graph.loops().iter().zip(&self.closures);
        let poses = self.graph.poses();
        let loops = loops.map(|(found, (_, closure))| SavedLoop::new(found, *closure, poses));
        SavedGraph {
            poses: poses.iter().copied().map(SavedPose).collect(),
            loops: loops.collect(),
            attached: self.attached().collect(),
            bridges: self.bridges().map(SavedEdge::from).collect(),
            next_loop: self.graph.next_loop,
            failures: self.failures,
        }
    }

    fn attached(&self) -> impl Iterator<Item = SavedAttachment> {
        let attachments = self.graph.attachments().iter().enumerate();
        attachments.filter_map(|(node, attachment)| {
            let Attachment { to, pose } = (*attachment)?;
            let (node, pose) = (KeyframeIdx(node), SavedPose(pose));
            Some(SavedAttachment { node, to, pose })
        })
    }

    /// Odometry over marginalized keyframes, by the keyframes that it leads to.
    fn bridges(&self) -> impl Iterator<Item = &Edge> {
        let mut before = None;
        self.graph.odometry().iter().filter(move |edge| {
            // The step to a keyframe comes before its intra-submap constraint.
            let is_step = before.replace(edge.to) != Some(edge.to);
            is_step && edge.from.0 + 1 < edge.to.0
        })
    }

    /// The graph that was saved, with its constraints of odometry; `None` where they do not fit
    /// each other.
    pub fn restore(
        &mut self,
        saved: SavedGraph,
        odometry: Vec<Edge>,
        closures: &[LoopClosure],
    ) -> Option<()> {
        let poses: Vec<Pose2> = saved.poses.iter().map(|pose| pose.0).collect();
        let mut ends = closures.iter().flat_map(|c| [c.older, c.newer]);
        if ends.any(|keyframe| keyframe.0 >= poses.len()) {
            return None;
        }
        let loops = saved.loops.iter().map(|l| l.restored(closures, &poses));
        let loops = loops.collect::<Option<Vec<_>>>()?;
        let names = saved.loops.iter().map(|l| (LoopId(l.id), l.closure));
        self.closures = names.collect();
        let attachments = saved.attachments()?;
        let bridges = saved.bridges.into_iter().map(Edge::from);
        let odometry = bridged(odometry, &attachments, bridges)?;
        self.graph =
            PoseGraph::restore(poses, attachments, odometry, loops, saved.next_loop).ok()?;
        self.failures = saved.failures;
        Some(())
    }
}
