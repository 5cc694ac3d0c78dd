//! Drives as the mapper adds them, with constraints inside their submaps, judged as a whole.

use super::super::testing::{add_intra_submap_constraints, close, drifting, edge, error_m, square};
use super::super::{Edge, PoseGraph};
use crate::index::KeyframeIdx;
use randt_geometry::Pose2;

/// Nodes of the drives: four laps of forty steps.
const STEPS: usize = 160;

/// A false cluster: ten steps of the last lap laid a corner ahead of where they were, each loop
/// agreeing with the others.
fn false_cluster() -> impl Iterator<Item = Edge> {
    let wrong = square(10).compose(&square(0).inverse());
    (0..10).map(move |k| {
        let there = wrong.compose(&square(k));
        edge(40 + k, 120 + k, square(k).between(&there))
    })
}

/// The drive with its odometry broken off before a node; loops are the caller's.
fn broken(at: usize) -> PoseGraph {
    let whole = with_submaps();
    let mut graph = PoseGraph::default();
    for node in 0..whole.poses().len() {
        // Its own coordinates, as a frame that begins anew has them.
        let begin = if node < at {
            square(node)
        } else {
            square(node - at)
        };
        graph.add_node(begin).unwrap();
    }
    for edge in whole.odometry() {
        if edge.to.0 < at || edge.from.0 >= at {
            graph.add_odometry(edge.clone()).unwrap();
        }
    }
    graph
}

/// The component of the last node, by its first node.
fn component_of_last(graph: &PoseGraph) -> Option<usize> {
    let last = graph.component_of(KeyframeIdx(STEPS));
    last.map(|component| component.0)
}

fn with_submaps() -> PoseGraph {
    let mut graph = drifting(STEPS);
    add_intra_submap_constraints(&mut graph);
    graph
}

/// A loop between steps two laps apart, wrong by this many metres.
fn across(step: usize, x_m: f64) -> Edge {
    let measured = square(step).between(&square(step + 80));
    edge(
        step,
        step + 80,
        measured.compose(&Pose2::new(x_m, 0.0, 0.0)),
    )
}

#[test]
fn intra_submap_constraints_and_good_loops_are_all_kept() {
    let mut graph = with_submaps();
    close(&mut graph, 2);
    let found = graph.recheck().unwrap();
    assert_eq!(found.off, 0, "{found:?}");
    assert!(error_m(&graph) < 0.3, "{}", error_m(&graph));
}

#[test]
fn a_false_cluster_of_ten_is_dropped() {
    let mut graph = with_submaps();
    close(&mut graph, 2);
    let good = graph.loops().len();
    for edge in false_cluster() {
        graph.add_loop(edge).unwrap();
    }
    let found = graph.recheck().unwrap();
    assert_eq!((found.on, found.off), (good, 10), "{found:?}");
    assert!(graph.loops()[..good].iter().all(|l| l.on));
    assert!(error_m(&graph) < 0.3, "{}", error_m(&graph));
}

#[test]
fn a_separate_component_stays_connected_by_loops_that_agree() {
    let mut graph = broken(85);
    for k in 0..5 {
        graph.add_loop(across(6 + 9 * k, 0.0)).unwrap();
    }
    let found = graph.recheck().unwrap();
    assert_eq!((found.on, found.off), (5, 0), "{found:?}");
    assert_eq!(component_of_last(&graph), Some(0));
    assert!(error_m(&graph) < 1.0, "{}", error_m(&graph));

    // Two that contradict them do not separate it again, and are not believed.
    graph.add_loop(across(10, 4.0)).unwrap();
    graph.add_loop(across(30, -3.0)).unwrap();
    let found = graph.recheck().unwrap();
    assert_eq!((found.on, found.off), (5, 2), "{found:?}");
    assert_eq!(component_of_last(&graph), Some(0));
    assert!(error_m(&graph) < 1.0, "{}", error_m(&graph));
}

#[test]
fn a_separate_component_is_not_connected_by_loops_that_contradict_each_other() {
    let mut graph = broken(85);
    for k in 0..6 {
        graph.add_loop(across(6 + 9 * k, 3.0 * k as f64)).unwrap();
    }
    // The estimate may have been bent to them before.
    graph.optimise().unwrap();
    assert_eq!(component_of_last(&graph), Some(0));
    let found = graph.recheck().unwrap();
    assert_eq!((found.on, found.off), (0, 6), "{found:?}");
    assert_eq!(component_of_last(&graph), Some(85));
}

#[test]
fn a_loop_alone_waits_where_it_could_be_false_by_chance() {
    // Odometry that a metre's step leaves as uncertain as a metre and a radian.
    let mut graph = PoseGraph::default();
    graph.add_node(square(0)).unwrap();
    for step in 1..=STEPS {
        let measured = square(step - 1).between(&square(step));
        let mut edge = edge(step - 1, step, measured);
        edge.information *= 0.002;
        graph.append(edge).unwrap();
    }
    let wrong = square(2).between(&square(42));
    let wrong = wrong.compose(&Pose2::new(4.0, 0.0, 1.0));
    graph.add_loop(edge(2, 42, wrong)).unwrap();
    for step in (80..120).step_by(2) {
        let measured = square(step).between(&square(step + 40));
        graph.add_loop(edge(step, step + 40, measured)).unwrap();
    }
    let found = graph.recheck().unwrap();
    assert_eq!((found.on, found.off), (20, 1), "{found:?}");
    assert!(!graph.loops()[0].on);
    // The same one where its neighbours agree.
    graph.add_loop(edge(3, 43, wrong)).unwrap();
    assert_eq!(graph.recheck().unwrap().off, 0);
}
