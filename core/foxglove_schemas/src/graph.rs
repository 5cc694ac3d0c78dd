//! `SceneUpdate`: the pose graph and its loops, put together from the pages in which the mapper
//! sends them.

use crate::MAP;
use crate::scene::{Colour, color, drawing, lines, point};
use foxglove::messages::SceneUpdate;
use foxglove::messages::line_primitive::Type;
use randt_geometry::elementary::sin_cos;
use randt_messages::{GraphEntry, GraphEntryKind, MapperGraph, MessageRef};
use std::collections::BTreeMap;

/// Keyframes of the component of the map that the newest one belongs to.
pub(crate) const PATH: Colour = [0.98, 0.55, 0.24, 1.0];
/// Those of other components: each has a frame of its own, and where they are drawn says nothing
/// of where they are.
pub(crate) const OTHER_COMPONENT: Colour = [0.55, 0.55, 0.6, 0.5];
/// A loop that is believed, and one that is hardly.
const BELIEVED: Colour = [0.16, 0.75, 0.35, 1.0];
const DOUBTED: Colour = [0.85, 0.6, 0.1, 0.5];
/// Length of the mark that says which way a keyframe looks, m.
const MARK_M: f64 = 0.3;

/// The newest whole graph that was received.
#[derive(Debug, Default)]
pub struct Graph {
    nodes: BTreeMap<u64, GraphEntry>,
    loops: Vec<GraphEntry>,
    /// Odometry frame of each keyframe, as far as it is known.
    frames: BTreeMap<u64, u64>,
    /// The pages of the next one, and its version.
    pages: Vec<GraphEntry>,
    version: u64,
}

impl Graph {
    /// Sets the odometry frame of a keyframe: no edge of odometry connects two frames.
    pub fn know(&mut self, keyframe_id: u64, odom_frame_id: u64) {
        self.frames.insert(keyframe_id, odom_frame_id);
    }

    /// Takes a page; whether with it a whole graph has become known. A graph that lacks a page is
    /// dropped.
    pub fn take(&mut self, message: MessageRef<'_, MapperGraph>) -> bool {
        let head = message.head;
        if message.items.is_empty() {
            return false;
        }
        if head.first_entry == 0 {
            self.pages.clear();
            self.version = head.graph_version;
        }
        if self.version != head.graph_version || self.pages.len() != head.first_entry as usize {
            return false;
        }
        self.pages.extend_from_slice(message.items);
        if (self.pages.len() as u64) < head.keyframes.saturating_add(head.loops) {
            return false;
        }
        let is_node = |entry: &GraphEntry| entry.kind == GraphEntryKind::Node as u32;
        let (nodes, loops) = self.pages.drain(..).partition(is_node);
        let nodes: Vec<GraphEntry> = nodes;
        self.nodes = nodes.into_iter().map(|node| (node.a, node)).collect();
        self.loops = loops;
        true
    }

    /// The version of the newest page.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The keyframes, in order.
    pub fn nodes(&self) -> impl DoubleEndedIterator<Item = &GraphEntry> {
        self.nodes.values()
    }

    /// The node of a keyframe.
    pub fn node(&self, keyframe_id: u64) -> Option<&GraphEntry> {
        self.nodes.get(&keyframe_id)
    }

    /// The loops in force, with the nodes that they connect, the older one first.
    pub fn loops(&self) -> impl Iterator<Item = (&GraphEntry, [&GraphEntry; 2])> {
        let ends = |edge: &GraphEntry| Some([self.nodes.get(&edge.a)?, self.nodes.get(&edge.b)?]);
        let edges = self.loops.iter();
        edges.filter_map(move |edge| Some((edge, ends(edge)?)))
    }

    /// Runs of keyframes that odometry connects.
    pub fn runs(&self) -> Vec<Vec<&GraphEntry>> {
        let mut runs: Vec<Vec<&GraphEntry>> = Vec::new();
        for node in self.nodes.values() {
            match runs.last_mut() {
                Some(run) if run.last().is_some_and(|last| self.is_connected(last, node)) => {
                    run.push(node);
                }
                _ => runs.push(vec![node]),
            }
        }
        runs
    }

    fn is_connected(&self, from: &GraphEntry, to: &GraphEntry) -> bool {
        let frame = |node: &GraphEntry| self.frames.get(&node.a);
        let same_frame = match (frame(from), frame(to)) {
            (Some(from), Some(to)) => from == to,
            _ => true,
        };
        from.b == to.b && same_frame
    }

    /// Keyframes and the edges of odometry between them, in `map`.
    pub fn draw(&self, stamp_ns: i64) -> SceneUpdate {
        let component = self.nodes.values().next_back().map(|node| node.b);
        let mut drawn = Vec::new();
        for run in self.runs() {
            let is_here = run.first().map(|node| node.b) == component;
            let colour = if is_here { PATH } else { OTHER_COMPONENT };
            let strip = run.iter().map(|node| position(node)).collect();
            drawn.push(lines(Type::LineStrip, strip, colour));
            let marks = run.iter().flat_map(|node| {
                let [x_m, y_m, yaw_rad] = node.pose;
                let (sine, cosine) = sin_cos(yaw_rad);
                let tip = [x_m + MARK_M * cosine, y_m + MARK_M * sine];
                [position(node), point(tip)]
            });
            drawn.push(lines(Type::LineList, marks.collect(), colour));
        }
        drawing(MAP, "graph", stamp_ns, drawn)
    }

    /// The loops in force, in `map`, the greener the more they are believed.
    pub fn draw_loops(&self, stamp_ns: i64) -> SceneUpdate {
        let mut line = lines(Type::LineList, Vec::new(), BELIEVED);
        for (edge, ends) in self.loops() {
            for end in ends {
                line.points.push(position(end));
                line.colors.push(color(belief(edge)));
            }
        }
        drawing(MAP, "loops", stamp_ns, vec![line])
    }
}

/// The colour of a loop: the greener, the more it is believed.
pub(crate) fn belief(edge: &GraphEntry) -> Colour {
    let weight = f64::from(edge.weight).clamp(0.0, 1.0);
    let mut colour = DOUBTED;
    for (from, to) in colour.iter_mut().zip(BELIEVED) {
        *from += weight * (to - *from);
    }
    colour
}

pub(crate) fn position(node: &GraphEntry) -> foxglove::messages::Point3 {
    point([node.pose[0], node.pose[1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Message;

    fn node(id: u64, component: u64) -> GraphEntry {
        GraphEntry {
            a: id,
            b: component,
            pose: [id as f64, 0.0, 0.0],
            weight: 1.0,
            kind: GraphEntryKind::Node as u32,
            ..GraphEntry::default()
        }
    }

    fn page(version: u64, first: u32, all: [u64; 2], items: &[GraphEntry]) -> Message<MapperGraph> {
        let mut page = Message::<MapperGraph>::default();
        page.head.graph_version = version;
        page.head.first_entry = first;
        [page.head.keyframes, page.head.loops] = all;
        page.items = items.to_vec();
        page
    }

    fn edge(a: u64, b: u64, weight: f32) -> GraphEntry {
        GraphEntry {
            a,
            b,
            weight,
            kind: GraphEntryKind::Loop as u32,
            ..GraphEntry::default()
        }
    }

    #[test]
    fn a_graph_is_there_when_all_its_pages_are() {
        let mut graph = Graph::default();
        let nodes: Vec<_> = (0..4).map(|id| node(id, 0)).collect();
        assert!(!graph.take(page(1, 0, [4, 1], &nodes[..2]).as_ref()));
        // The heartbeat has no entries.
        assert!(!graph.take(page(1, 0, [4, 1], &[]).as_ref()));
        assert!(graph.take(page(1, 2, [4, 1], &[nodes[2], nodes[3], edge(0, 3, 1.0)]).as_ref()));
        assert_eq!((graph.nodes().count(), graph.loops().count()), (4, 1));
        // One page is missing: the one before is still the newest whole one.
        assert!(!graph.take(page(2, 0, [6, 0], &nodes[..2]).as_ref()));
        assert!(!graph.take(page(2, 4, [6, 0], &nodes[..2]).as_ref()));
        assert!(!graph.take(page(3, 2, [3, 0], &nodes[2..3]).as_ref()));
        assert_eq!(graph.nodes().count(), 4);
    }

    #[test]
    fn odometry_connects_neither_components_nor_frames() {
        let mut graph = Graph::default();
        let nodes = [node(0, 0), node(1, 0), node(2, 0), node(3, 3), node(4, 3)];
        assert!(graph.take(page(1, 0, [5, 0], &nodes).as_ref()));
        assert_eq!(
            graph.runs().iter().map(Vec::len).collect::<Vec<_>>(),
            [3, 2]
        );
        (0..2).for_each(|id| graph.know(id, 7));
        graph.know(2, 8);
        assert_eq!(
            graph.runs().iter().map(Vec::len).collect::<Vec<_>>(),
            [2, 1, 2]
        );
        let lines = &graph.draw(0).entities[0].lines;
        assert_eq!(lines.len(), 6);
        assert_eq!(lines[0].color.unwrap().a, OTHER_COMPONENT[3]);
        assert_eq!(lines[4].color.unwrap().a, PATH[3]);
        assert_eq!(lines[5].points.len(), 4);
    }

    #[test]
    fn loops_are_the_greener_the_more_they_are_believed() {
        let mut graph = Graph::default();
        let entries = [
            node(0, 0),
            node(1, 0),
            edge(0, 1, 1.0),
            edge(0, 1, 0.1),
            edge(0, 9, 1.0),
        ];
        assert!(graph.take(page(1, 0, [2, 3], &entries).as_ref()));
        let update = graph.draw_loops(0);
        let line = &update.entities[0].lines[0];
        // One leads to a keyframe that is not there.
        assert_eq!((line.points.len(), line.colors.len()), (4, 4));
        assert!((line.colors[0].g - BELIEVED[1]).abs() < 1e-9 && line.colors[0].a > 0.99);
        assert!(line.colors[2].g < line.colors[0].g && line.colors[2].r > line.colors[0].r);
    }
}
