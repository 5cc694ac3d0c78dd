//! `SceneUpdate` of the pose graph: the path over the keyframes, and the loops.

use crate::{MAP, pose_of, scene};
use foxglove::messages::{Color, LinePrimitive, Point3, SceneEntity, SceneUpdate, line_primitive};
use randt_messages::{GraphEntry, GraphEntryKind, MapperGraph, MessageRef};
use std::collections::HashMap;

/// Keyframes or loops that go together: a piece of at most some 2 kB, so that only what changed is sent.
const PIECE: usize = 64;
/// Lines lie above the floor, m.
const ABOVE_M: f64 = 0.03;

const PATH_COLOUR: Color = Color {
    r: 0.1,
    g: 0.4,
    b: 0.9,
    a: 1.0,
};
const LOOP_COLOUR: Color = Color {
    r: 0.9,
    g: 0.5,
    b: 0.0,
    a: 0.8,
};

/// The graph as it comes, page by page.
#[derive(Debug, Default)]
pub struct Graph {
    version: u64,
    entries: Vec<GraphEntry>,
}

impl Graph {
    /// Takes a message; gives whether the graph is whole with it. A page without entries is a sign of life.
    pub fn take(&mut self, page: MessageRef<'_, MapperGraph>) -> bool {
        let head = page.head;
        if page.items.is_empty() {
            return false;
        }
        if head.first_entry == 0 {
            self.version = head.graph_version;
            self.entries.clear();
        }
        if self.version != head.graph_version || self.entries.len() != head.first_entry as usize {
            return false;
        }
        self.entries.extend_from_slice(page.items);
        self.entries.len() as u64 == head.keyframes.saturating_add(head.loops)
    }

    /// The graph as pieces with a name each, "path N" and "loops N". They have no stamp: what is fixed to `map` needs none,
    /// and so a piece that has not changed is the same bytes.
    pub fn draw(&self) -> Vec<(String, SceneUpdate)> {
        let is_node = |entry: &&GraphEntry| entry.kind == GraphEntryKind::Node as u32;
        let nodes: Vec<_> = self.entries.iter().filter(is_node).collect();
        let places: HashMap<u64, Point3> = nodes.iter().map(|n| (n.a, point(n))).collect();
        let loops: Vec<_> = self.entries.iter().filter(|e| !is_node(e)).collect();
        let paths = (0..nodes.len()).step_by(PIECE).map(|first| {
            // Together with the one before, so that no link is missing.
            let piece = nodes.iter().skip(first.saturating_sub(1));
            let count = PIECE + usize::from(first > 0);
            let strips = strips(piece.take(count).copied());
            (format!("path {}", first / PIECE), strips)
        });
        let loops = loops.chunks(PIECE).enumerate().map(|(number, piece)| {
            let ends = piece
                .iter()
                .filter_map(|l| Some([*places.get(&l.a)?, *places.get(&l.b)?]));
            let points = ends.flatten().collect();
            let kind = line_primitive::Type::LineList;
            (
                format!("loops {number}"),
                vec![line(kind, points, LOOP_COLOUR)],
            )
        });
        let drawn = paths.chain(loops).map(|(id, lines)| {
            let entity = SceneEntity {
                frame_id: MAP.to_owned(),
                id: id.clone(),
                lines,
                ..SceneEntity::default()
            };
            (id, scene(entity))
        });
        drawn.collect()
    }
}

/// A piece that is gone: it takes the place of the one of its name.
pub fn nothing(name: &str) -> SceneUpdate {
    scene(SceneEntity {
        frame_id: MAP.to_owned(),
        id: name.to_owned(),
        ..SceneEntity::default()
    })
}

/// One line a part of the map: parts have nothing in common.
fn strips<'a>(nodes: impl Iterator<Item = &'a GraphEntry>) -> Vec<LinePrimitive> {
    let mut lines: Vec<LinePrimitive> = Vec::new();
    let mut part = None;
    for node in nodes {
        if part != Some(node.b) {
            part = Some(node.b);
            let kind = line_primitive::Type::LineStrip;
            lines.push(line(kind, Vec::new(), PATH_COLOUR));
        }
        if let Some(last) = lines.last_mut() {
            last.points.push(point(node));
        }
    }
    lines
}

fn point(node: &GraphEntry) -> Point3 {
    let [x, y, _] = node.pose;
    Point3 { x, y, z: 0.0 }
}

fn line(kind: line_primitive::Type, points: Vec<Point3>, colour: Color) -> LinePrimitive {
    let mut pose = pose_of([0.0; 3]);
    if let Some(position) = &mut pose.position {
        position.z = ABOVE_M;
    }
    LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose),
        thickness: 2.0,
        scale_invariant: true,
        points,
        color: Some(colour),
        ..LinePrimitive::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Message;

    fn node(a: u64, b: u64) -> GraphEntry {
        let pose = [a as f64, 0.5, 0.0];
        let weight = 1.0;
        GraphEntry {
            a,
            b,
            stamp_ns: 0,
            pose,
            weight,
            kind: GraphEntryKind::Node as u32,
        }
    }

    #[test]
    fn a_graph_of_pages_is_drawn_in_pieces() {
        let mut entries: Vec<_> = (0..100)
            .map(|id| node(id, if id < 70 { 0 } else { 70 }))
            .collect();
        entries.push(GraphEntry {
            kind: GraphEntryKind::Loop as u32,
            ..node(3, 60)
        });
        let mut graph = Graph::default();
        let mut page = Message::<MapperGraph>::default();
        (page.head.keyframes, page.head.loops) = (100, 1);
        let mut take = |first: usize, items: &[GraphEntry]| {
            page.head.first_entry = first as u32;
            page.items = items.to_vec();
            graph.take(page.as_ref())
        };
        assert!(!take(0, &entries[..50]));
        assert!(!take(0, &[]), "a sign of life is no page");
        assert!(!take(60, &entries[60..]), "a page is missing");
        assert!(take(50, &entries[50..]));
        let drawn = graph.draw();
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
