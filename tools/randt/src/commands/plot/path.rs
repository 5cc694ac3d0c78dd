//! The drive from above, in the style of a run's `plot.svg`: the path as it was known live, and
//! over it as the map has it at the end, with returns and loops.

use super::Picture;
use super::recording::{Recording, Sketch};
use crate::components::Components;
use crate::final_poses::{Knot, carry_into_map};
use crate::results::thinned_returns;
use randt_evaluation::{Plot, TrajectoryPose, plot_trajectories, truth_on_estimate};
use randt_geometry::Pose2;
use randt_messages::OdometryState;
use std::collections::BTreeMap;

/// Draws it; without a map the path is odometry's, and without odometry the truth's, where there
/// is one.
pub fn draw(recording: &Recording, title: &str) -> anyhow::Result<Picture> {
    let truth = &recording.truth;
    if recording.states.is_empty() && truth.poses().is_empty() {
        return Ok(Err("odometry/state"));
    }
    let keyframes = keyframes(recording);
    let mut knots: Vec<Knot> = keyframes.iter().map(MapKeyframe::knot).collect();
    knots.sort_by_key(|knot| knot.key);
    let states: Vec<OdometryState> = recording.states.iter().map(|(_, state)| *state).collect();
    let trajectory = carry_into_map(&states, &knots);
    let largest = largest_component(&keyframes);
    let parts = Components::from_trajectory(&trajectory, largest.unwrap_or_default());
    let truth = match trajectory.poses() {
        [] => truth
            .poses()
            .iter()
            .map(TrajectoryPose::position_m)
            .collect(),
        _ if truth.poses().is_empty() => Vec::new(),
        _ => truth_on_estimate(&parts.shown, truth)?,
    };
    let loops = recording.graph.loops();
    let loops = loops.filter(|(_, ends)| ends.iter().all(|node| node.b == parts.component));
    let loops = loops.map(|(_, ends)| ends.map(|node| [node.pose[0], node.pose[1]]));
    let loops: Vec<[[f64; 2]; 2]> = loops.collect();
    Ok(Ok(plot_trajectories(&Plot {
        title: &match (trajectory.poses(), recording.graph.nodes().next()) {
            ([], _) => format!("{title} (the truth alone)"),
            (_, None) => format!("{title} (odometry, without a map)"),
            _ => title.to_owned(),
        },
        estimate: &parts.lines,
        // Where there is a final path to compare it with.
        live: &match trajectory.poses() {
            [] => Vec::new(),
            _ => Components::from_trajectory(&recording.live, parts.component).lines,
        },
        truth: &truth,
        map: &returns(&keyframes, parts.component),
        loops: &loops,
        apart: &parts.apart,
    })?))
}

/// A keyframe, and where it stands.
struct MapKeyframe<'a> {
    sketch: &'a Sketch,
    component: u64,
    map: Pose2,
}

impl MapKeyframe<'_> {
    fn knot(&self) -> Knot {
        Knot {
            key: (self.sketch.odom_frame_id, self.sketch.stamp_ns),
            component: self.component,
            odom: self.sketch.pose,
            map: self.map,
        }
    }
}

/// The keyframes that the newest graph has; all of them where odometry has them, when there is no
/// graph.
fn keyframes(recording: &Recording) -> Vec<MapKeyframe<'_>> {
    let has_graph = recording.graph.nodes().next().is_some();
    let keyframe = |(id, sketch): (&u64, _)| match recording.graph.node(*id) {
        Some(node) => Some(MapKeyframe {
            sketch,
            component: node.b,
            map: Pose2::from_array(node.pose),
        }),
        None if has_graph => None,
        None => Some(MapKeyframe {
            sketch,
            component: sketch.odom_frame_id,
            map: sketch.pose,
        }),
    };
    recording.keyframes.iter().filter_map(keyframe).collect()
}

/// The component of most keyframes.
fn largest_component(keyframes: &[MapKeyframe<'_>]) -> Option<u64> {
    let mut sizes: BTreeMap<u64, usize> = BTreeMap::new();
    for keyframe in keyframes {
        *sizes.entry(keyframe.component).or_default() += 1;
    }
    let largest = sizes.into_iter().max_by_key(|(_, size)| *size);
    largest.map(|(component, _)| component)
}

/// Returns of a component, thinned out: components share no frame.
fn returns(keyframes: &[MapKeyframe<'_>], component: u64) -> Vec<[f64; 2]> {
    let chosen = keyframes.iter().filter(|it| it.component == component);
    let chosen = chosen.map(|it| (&it.map, it.sketch.points.as_slice()));
    thinned_returns(chosen, 1, |point| *point)
}
