//! The grid follows the largest component of the map.

use super::{Grid, GridKeyframe, GridUpdate};
use crate::index::KeyframeIdx;
use crate::keyframe::MapKeyframe;
use crate::pose_graph::KeyframeGraph;

impl Grid {
    /// Brings the grid up to the keyframes of the largest component and where they are now; those
    /// of others are taken out. No more than `added_max` are painted for the first time.
    pub(crate) fn follow(
        &mut self,
        keyframes: &[MapKeyframe],
        graph: &KeyframeGraph,
        added_max: usize,
    ) -> GridUpdate {
        let component = graph.largest_component();
        let all = keyframes.iter().zip(graph.poses()).enumerate();
        let all = all.map(|(index, (keyframe, map_from_base))| {
            let painted = GridKeyframe {
                id: keyframe.keyframe_id,
                map_from_base: *map_from_base,
                observation: &keyframe.observation,
            };
            (graph.component_of(KeyframeIdx(index)) == component, painted)
        });
        let (mut keep, mut leave) = (Vec::new(), Vec::new());
        all.for_each(|(is_kept, painted)| {
            if is_kept { &mut keep } else { &mut leave }.push(painted)
        });
        let mut added = 0;
        keep.retain(|keyframe| {
            added += usize::from(self.lacks(keyframe));
            added <= added_max || !self.lacks(keyframe)
        });
        let removed = self.remove(&leave);
        let mut update = self.update(&keep);
        update.removed += removed;
        update
    }
}
