//! Markers of ROS for recordings: the pose graph, its loops, the cells of a submap.

use crate::ellipse::{COLOURS, DEVIATIONS, Scale};
use crate::graph::{Graph, OTHER_COMPONENT, PATH, belief, position};
use crate::{MAP, ODOM};
use randt_geometry::Pose2;
use randt_geometry::elementary::atan2;
use randt_messages::GraphEntry;
use randt_ndt::Cell;
use randt_ros_messages::{Marker, Shape, Style, markers};

/// Keyframes and the edges of odometry between them, in `map`.
pub fn graph_markers(graph: &Graph, stamp_ns: i64) -> Vec<u8> {
    let component = graph.nodes().next_back().map(|node| node.b);
    let runs = graph.runs();
    let strips = runs.iter().map(|run| Marker {
        shape: Shape::Strip(run.iter().map(|node| planar(node)).collect()),
        colour: match run.first().map(|node| node.b) == component {
            true => PATH,
            false => OTHER_COMPONENT,
        }
        .map(|part| part as f32),
    });
    let strips: Vec<Marker> = strips.collect();
    markers(Style::Cdr, stamp_ns, MAP, "graph", &strips)
}

/// The loops in force, in `map`, the greener the more they are believed.
pub fn loop_markers(graph: &Graph, stamp_ns: i64) -> Vec<u8> {
    let (mut points, mut colours) = (Vec::new(), Vec::new());
    for (edge, ends) in graph.loops() {
        for end in ends {
            points.push(planar(end));
            colours.push(belief(edge).map(|part| part as f32));
        }
    }
    let lines = Marker {
        shape: Shape::Lines(points, colours),
        colour: PATH.map(|part| part as f32),
    };
    let is_empty = graph.loops().next().is_none();
    let shown: &[Marker] = if is_empty { &[] } else { &[lines] };
    markers(Style::Cdr, stamp_ns, MAP, "loops", shown)
}

/// Cells in the frame of a root, that lies in `odom` (x m, y m, yaw rad), as ellipses of two
/// standard deviations, coloured by their mean intensity.
pub fn cell_markers<'a>(
    cells: impl Iterator<Item = &'a Cell>,
    root: [f64; 3],
    stamp_ns: i64,
) -> Vec<u8> {
    let cells: Vec<&Cell> = cells.collect();
    let scale = Scale::from_cells(&cells);
    let root = Pose2::from_array(root);
    let discs = cells.iter().map(|cell| {
        let [xx, xy, yy, ..] = cell.covariance;
        // Axes of a symmetric matrix of two rows.
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let apart = (half * half + xy * xy).sqrt();
        let yaw_rad = 0.5 * atan2(xy, half);
        let axes = [middle + apart, middle - apart];
        let at = root.compose(&Pose2::new(cell.mean[0], cell.mean[1], yaw_rad));
        let colour = COLOURS.get(scale.colour(cell)).copied().unwrap_or(PATH);
        Marker {
            shape: Shape::Disc(
                at.to_array(),
                axes.map(|variance| 2.0 * DEVIATIONS * variance.max(0.0).sqrt()),
            ),
            colour: colour.map(|part| part as f32),
        }
    });
    let discs: Vec<Marker> = discs.collect();
    markers(Style::Cdr, stamp_ns, ODOM, "cells", &discs)
}

/// A node's position in `map`, m.
fn planar(node: &GraphEntry) -> [f64; 2] {
    let point = position(node);
    [point.x, point.y]
}
