//! A file's graph as the mapper's: odometry, loops, and the start from odometry alone.

use anyhow::ensure;
use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_mapper::KeyframeIdx;
use randt_mapper::pose_graph::{Edge, PoseGraph};
use randt_readers::g2o;
use std::collections::BTreeMap;

/// A graph to solve.
pub(super) struct Problem {
    /// Where each node begins: where odometry puts it.
    start: Vec<Pose2>,
    odometry: Vec<Edge>,
    loops: Vec<Edge>,
}

impl Problem {
    /// Nodes in the order of their ids. The first edge from an id to the next is odometry, every
    /// other one a loop.
    pub fn new(file: &g2o::Graph) -> anyhow::Result<Self> {
        let vertices: BTreeMap<u64, Pose2> = file.vertices.iter().copied().collect();
        // A file may leave its vertices out, but not some of them.
        if !vertices.is_empty() {
            for edge in &file.edges {
                for id in [edge.from, edge.to] {
                    let (from, to) = (edge.from, edge.to);
                    ensure!(
                        vertices.contains_key(&id),
                        "EDGE_SE2 {from} {to}: there is no VERTEX_SE2 {id} in it"
                    );
                }
            }
        }
        let edge_ids = file.edges.iter().flat_map(|edge| [edge.from, edge.to]);
        let mut ids: Vec<u64> = vertices.keys().copied().chain(edge_ids).collect();
        ids.sort_unstable();
        ids.dedup();
        ensure!(!ids.is_empty(), "no VERTEX_SE2 and no EDGE_SE2 in it");
        let mut odometry: Vec<Option<Edge>> = vec![None; ids.len()];
        let mut loops = Vec::new();
        for edge in &file.edges {
            let node = |id: u64| ids.partition_point(|other| *other < id);
            let [a, b, c] = edge.information;
            let read = Edge {
                from: KeyframeIdx(node(edge.from)),
                to: KeyframeIdx(node(edge.to)),
                measured: edge.measured,
                information: Matrix3::from_row_slice(&[a, b, c].concat()),
            };
            match odometry.get_mut(read.to.0) {
                Some(slot @ None) if edge.from.checked_add(1) == Some(edge.to) => {
                    *slot = Some(read)
                }
                _ => loops.push(read),
            }
        }
        let mut start: Vec<Pose2> = Vec::with_capacity(ids.len());
        for (id, edge) in ids.iter().zip(&odometry) {
            // Where the chain is broken the file's own pose is all there is.
            let begin = || vertices.get(id).copied().unwrap_or_default();
            let pose = match (edge, start.last()) {
                (Some(edge), Some(before)) => before.compose(&edge.measured),
                _ => begin(),
            };
            start.push(pose);
        }
        Ok(Self {
            start,
            odometry: odometry.into_iter().flatten().collect(),
            loops,
        })
    }

    /// The graph, not solved.
    pub fn graph(&self) -> anyhow::Result<PoseGraph> {
        let mut graph = PoseGraph::default();
        for pose in &self.start {
            graph.add_node(*pose)?;
        }
        for edge in &self.odometry {
            graph.add_odometry(edge.clone())?;
        }
        for edge in &self.loops {
            graph.add_loop(edge.clone())?;
        }
        Ok(graph)
    }
}
