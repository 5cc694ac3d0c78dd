//! `SceneUpdate` of the pose graph as several entities: over a slow link only those that changed
//! are sent.

use crate::graph::{Graph, position};
use crate::scene::{Colour, lines, update};
use crate::{MAP, pose_above};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{LinePrimitive, SceneEntity, SceneUpdate};
use randt_messages::GraphEntry;

/// Keyframes or loops of one entity: at most some 2 kB.
const ENTITY_ITEMS: usize = 64;
/// Lines lie above the floor, m.
const ABOVE_M: f64 = 0.03;
const PATH: Colour = [0.1, 0.4, 0.9, 1.0];
const LOOP: Colour = [0.9, 0.5, 0.0, 0.8];

/// The graph as entities with a name each, "path N" and "loops N". They have no stamp: what is
/// fixed to `map` needs none, and so an entity that has not changed is the same bytes.
pub fn graph_entities(graph: &Graph) -> Vec<(String, SceneUpdate)> {
    let nodes: Vec<&GraphEntry> = graph.nodes().collect();
    let ends: Vec<[&GraphEntry; 2]> = graph.loops().map(|(_, ends)| ends).collect();
    let paths = (0..nodes.len()).step_by(ENTITY_ITEMS).map(|first| {
        // Together with the one before, so that no link is missing.
        let group = nodes.iter().skip(first.saturating_sub(1));
        let count = ENTITY_ITEMS + usize::from(first > 0);
        (
            format!("path {}", first / ENTITY_ITEMS),
            strips(group.take(count).copied()),
        )
    });
    let loops = ends
        .chunks(ENTITY_ITEMS)
        .enumerate()
        .map(|(number, group)| {
            let points = group.iter().flatten().map(|node| position(node)).collect();
            let line = above(lines(Type::LineList, points, LOOP));
            (format!("loops {number}"), vec![line])
        });
    let drawn = paths.chain(loops);
    drawn
        .map(|(name, lines)| (name.clone(), entity(&name, lines)))
        .collect()
}

/// An entity without content: it replaces the one of its name.
pub fn empty_entity(name: &str) -> SceneUpdate {
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

/// One line for each component of the map: components have nothing in common.
fn strips<'a>(nodes: impl Iterator<Item = &'a GraphEntry>) -> Vec<LinePrimitive> {
    let mut strips: Vec<LinePrimitive> = Vec::new();
    let mut component = None;
    for node in nodes {
        if component != Some(node.b) {
            component = Some(node.b);
            strips.push(above(lines(Type::LineStrip, Vec::new(), PATH)));
        }
        if let Some(last) = strips.last_mut() {
            last.points.push(position(node));
        }
    }
    strips
}

fn above(mut line: LinePrimitive) -> LinePrimitive {
    line.pose = Some(pose_above([0.0; 3], ABOVE_M));
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
    fn a_graph_is_drawn_as_several_entities() {
        let components = (0..100).map(|id| node(id, if id < 70 { 0 } else { 70 }));
        let mut page = Message::<MapperGraph> {
            items: components.collect(),
            ..Message::default()
        };
        page.items.push(GraphEntry {
            kind: GraphEntryKind::Loop as u32,
            ..node(3, 60)
        });
        (page.head.keyframes, page.head.loops) = (100, 1);
        let mut graph = Graph::default();
        assert!(graph.take(page.as_ref()));
        let drawn = graph_entities(&graph);
        let names: Vec<_> = drawn.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["path 0", "path 1", "loops 0"]);
        let lines = |at: usize| &drawn[at].1.entities[0].lines;
        assert_eq!(lines(0)[0].points.len(), 64);
        // From the last one of the first entity on, and a gap where a component begins.
        let lengths: Vec<_> = lines(1).iter().map(|line| line.points.len()).collect();
        assert_eq!(lengths, [7, 30]);
        assert_eq!(lines(2)[0].points[1].x, 60.0);
    }
}
