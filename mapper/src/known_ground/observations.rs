//! What keyframes that have left the graph saw, as long as somebody asks for it.
//!
//! A node's submap reaches over its neighbours on the path, and the grid shows each place as it
//! was seen last. All else that they saw is forgotten, so that memory grows with the ground. What
//! is held follows from keyframes and graph, so that a map that comes back holds the same.

use crate::index::KeyframeIdx;
use crate::keyframe::MapKeyframe;
use crate::pose_graph::KeyframeGraph;
use std::collections::BTreeSet;

/// The keyframes that have left the graph and whose observations are held.
#[derive(Clone, Debug)]
pub(crate) struct LeftObservations {
    held: BTreeSet<KeyframeIdx>,
    /// Path from a node within which its submap may have keyframes, m.
    reach_m: f64,
}

impl LeftObservations {
    /// None yet; a node's submap ends at this path from it.
    pub fn new(reach_m: f64) -> Self {
        Self {
            held: BTreeSet::new(),
            reach_m,
        }
    }

    /// A keyframe has left the graph.
    pub fn push(&mut self, keyframe: KeyframeIdx) {
        self.held.insert(keyframe);
    }

    /// Whether the observation of a keyframe that has left is held.
    pub fn holds(&self, keyframe: KeyframeIdx) -> bool {
        self.held.contains(&keyframe)
    }

    /// Lets those go that nobody asks for any more, and gives them. Nobody will again: nodes only
    /// come behind the newest keyframe, and a place is never shown by an older one.
    pub fn take_unneeded(
        &mut self,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
    ) -> Vec<KeyframeIdx> {
        let reach_m = self.reach_m;
        let is_unneeded = |keyframe: &KeyframeIdx| {
            !graph.shows(*keyframe) && !is_near_node(*keyframe, reach_m, keyframes, graph)
        };
        let held = self.held.iter().copied();
        let unneeded: Vec<KeyframeIdx> = held.filter(is_unneeded).collect();
        self.held
            .retain(|keyframe| unneeded.binary_search(keyframe).is_err());
        unneeded
    }
}

/// Whether a keyframe lies within a reach of path of a node of its frame.
fn is_near_node(
    keyframe: KeyframeIdx,
    reach_m: f64,
    keyframes: &[MapKeyframe],
    graph: &KeyframeGraph,
) -> bool {
    let Some(here) = keyframes.get(keyframe.0) else {
        return false;
    };
    let is_near = |(_, other): &(usize, &MapKeyframe)| {
        other.odom_frame_id == here.odom_frame_id && (other.path_m - here.path_m).abs() <= reach_m
    };
    let is_node = |(index, _): (usize, &MapKeyframe)| graph.is_unknown(KeyframeIdx(index));
    let all = || keyframes.iter().enumerate();
    let before = keyframes.len() - keyframe.0;
    let onwards = all().skip(keyframe.0).take_while(is_near);
    let backwards = all().rev().skip(before).take_while(is_near);
    onwards.chain(backwards).any(is_node)
}
