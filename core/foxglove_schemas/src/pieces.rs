//! `SceneUpdate` of the pose graph in pieces: over a slow link only those that changed are sent.

use crate::MAP;
use crate::graph::Graph;
use crate::scene::{Colour, lines, point, update};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{LinePrimitive, SceneEntity, SceneUpdate};
use randt_messages::GraphEntry;

/// Keyframes or loops that go together: a piece of at most some 2 kB.
const PIECE: usize = 64;
/// Lines lie above the floor, m.
const ABOVE_M: f64 = 0.03;
const PATH: Colour = [0.1, 0.4, 0.9, 1.0];
const LOOP: Colour = [0.9, 0.5, 0.0, 0.8];

/// The graph as pieces with a name each, "path N" and "loops N". They have no stamp: what is fixed to `map` needs none,
/// and so a piece that has not changed is the same bytes.
pub fn pieces(graph: &Graph) -> Vec<(String, SceneUpdate)> {
    let nodes: Vec<&GraphEntry> = graph.nodes().collect();
    let ends: Vec<[&GraphEntry; 2]> = graph.loops().map(|(_, ends)| ends).collect();
    let paths = (0..nodes.len()).step_by(PIECE).map(|first| {
        // Together with the one before, so that no link is missing.
        let piece = nodes.iter().skip(first.saturating_sub(1));
        let count = PIECE + usize::from(first > 0);
        (
            format!("path {}", first / PIECE),
            strips(piece.take(count).copied()),
        )
    });
    let loops = ends.chunks(PIECE).enumerate().map(|(number, piece)| {
        let points = piece.iter().flatten().map(|node| place(node)).collect();
        let line = above(lines(Type::LineList, points, LOOP));
        (format!("loops {number}"), vec![line])
    });
    let drawn = paths.chain(loops);
    drawn
        .map(|(name, lines)| (name.clone(), entity(&name, lines)))
        .collect()
}

/// A piece that is gone: it takes the place of the one of its name.
pub fn nothing(name: &str) -> SceneUpdate {
    entity(name, Vec::new())
}

fn entity(name: &str, lines: Vec<LinePrimitive>) -> SceneUpdate {
    update(SceneEntity {
        frame_id: MAP.to_owned(),
        id: name.to_owned(),
        lines,
        ..SceneEntity::default()
    })
}

/// One line a part of the map: parts have nothing in common.
fn strips<'a>(nodes: impl Iterator<Item = &'a GraphEntry>) -> Vec<LinePrimitive> {
    let mut strips: Vec<LinePrimitive> = Vec::new();
    let mut part = None;
    for node in nodes {
        if part != Some(node.b) {
            part = Some(node.b);
            strips.push(above(lines(Type::LineStrip, Vec::new(), PATH)));
        }
        if let Some(last) = strips.last_mut() {
            last.points.push(place(node));
        }
    }
    strips
}

fn place(node: &GraphEntry) -> foxglove::messages::Point3 {
    point([node.pose[0], node.pose[1]])
}

fn above(mut line: LinePrimitive) -> LinePrimitive {
    if let Some(position) = line.pose.as_mut().and_then(|pose| pose.position.as_mut()) {
        position.z = ABOVE_M;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{GraphEntryKind, MapperGraph, Message};

    fn node(a: u64, b: u64) -> GraphEntry {
        GraphEntry {
            a,
            b,
            pose: [a as f64, 0.5, 0.0],
            weight: 1.0,
            kind: GraphEntryKind::Node as u32,
            ..GraphEntry::default()
        }
    }

    #[test]
    fn a_graph_is_drawn_in_pieces() {
        let parts = (0..100).map(|id| node(id, if id < 70 { 0 } else { 70 }));
        let mut page = Message::<MapperGraph> {
            items: parts.collect(),
            ..Message::default()
        };
        page.items.push(GraphEntry {
            kind: GraphEntryKind::Loop as u32,
            ..node(3, 60)
        });
        (page.head.keyframes, page.head.loops) = (100, 1);
        let mut graph = Graph::default();
        assert!(graph.take(page.as_ref()));
        let drawn = pieces(&graph);
        let names: Vec<_> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["path 0", "path 1", "loops 0"]);
        let lines = |at: usize| &drawn[at].1.entities[0].lines;
        assert_eq!(lines(0)[0].points.len(), 64);
        // From the last one of the first piece on, and a gap where a part begins.
        let lengths: Vec<_> = lines(1).iter().map(|line| line.points.len()).collect();
        assert_eq!(lengths, [7, 30]);
        assert_eq!(lines(2)[0].points[1].x, 60.0);
    }
}
