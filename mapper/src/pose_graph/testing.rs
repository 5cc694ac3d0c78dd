//! Graphs for the tests of this module.

use super::{Edge, PoseGraph};
use crate::index::KeyframeIdx;
use nalgebra::Matrix3;
use randt_geometry::Pose2;

/// A measurement that claims 5 cm and 3 degrees.
pub(super) fn edge(from: usize, to: usize, measured: Pose2) -> Edge {
    Edge {
        from: KeyframeIdx(from),
        to: KeyframeIdx(to),
        measured,
        information: Matrix3::from_diagonal(&[400.0, 400.0, 365.0].into()),
    }
}

/// Where a drive of metre steps on a square of 10 m is after `step` steps; it passes every spot
/// again and again.
pub(super) fn square(step: usize) -> Pose2 {
    let (side, along) = (step / 10 % 4, (step % 10) as f64);
    let (x_m, y_m) = match side {
        0 => (along, 0.0),
        1 => (10.0, along),
        2 => (10.0 - along, 10.0),
        _ => (0.0, 10.0 - along),
    };
    Pose2::new(x_m, y_m, side as f64 * core::f64::consts::FRAC_PI_2)
}

/// The odometry of that drive: every step's heading is off by a hundredth, so the laps drift
/// apart.
pub(super) fn drifting(steps: usize) -> PoseGraph {
    let mut graph = PoseGraph::default();
    graph.add_node(square(0)).unwrap();
    for step in 1..=steps {
        let measured = square(step - 1).between(&square(step));
        let turned = measured.compose(&Pose2::new(0.0, 0.0, 0.01));
        graph.append(edge(step - 1, step, turned)).unwrap();
    }
    graph
}

/// Holds every step by the first of its thirty, as the mapper does, sharper than the chain of
/// steps.
pub(super) fn add_intra_submap_constraints(graph: &mut PoseGraph) {
    for step in 0..graph.poses().len() {
        let root = step / 30 * 30;
        if root + 1 < step {
            let measured = square(root).between(&square(step));
            let mut edge = edge(root, step, measured);
            edge.information *= 4.0;
            graph.add_odometry(edge).unwrap();
        }
    }
}

/// Adds true loops between all laps, `every` steps.
pub(super) fn close(graph: &mut PoseGraph, every: usize) {
    for step in (40..graph.poses().len()).step_by(every) {
        let measured = square(step - 40).between(&square(step));
        graph.add_loop(edge(step - 40, step, measured)).unwrap();
    }
}

/// Largest distance from where the drive was, m.
pub(super) fn error_m(graph: &PoseGraph) -> f64 {
    let distances = graph.poses().iter().enumerate();
    distances
        .map(|(step, pose)| (pose.translation() - square(step).translation()).norm())
        .fold(0.0, f64::max)
}
