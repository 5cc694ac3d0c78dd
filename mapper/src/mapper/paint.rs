//! The occupancy grid of the map's largest part.

use super::Mapper;
use crate::grid::{Grid, GridKeyframe, GridUpdate};

impl Mapper {
    /// Brings the grid up to the keyframes and where they stand now. Not part of every step: whoever needs the grid
    /// decides how often.
    pub fn update_grid(&mut self) -> GridUpdate {
        self.update_grid_by(usize::MAX)
    }

    /// The same with no more than so many keyframes painted for the first time: where there were as many there may be
    /// more.
    pub fn update_grid_by(&mut self, added_max: usize) -> GridUpdate {
        let part = self.largest_part();
        let (places, graph) = (&self.places, &self.graph);
        let of_part = |inside: bool| -> Vec<GridKeyframe<'_>> {
            let all = places.iter().zip(graph.poses()).enumerate();
            all.filter(|(index, _)| (graph.component_of(*index) == Some(part)) == inside)
                .map(|(_, (place, pose))| GridKeyframe {
                    id: place.keyframe_id,
                    pose: *pose,
                    sight: &place.sight,
                })
                .collect()
        };
        let (mut keep, leave) = (of_part(true), of_part(false));
        let mut added = 0;
        keep.retain(|keyframe| {
            added += usize::from(self.grid.lacks(keyframe));
            added <= added_max || !self.grid.lacks(keyframe)
        });
        let left = self.grid.remove(&leave);
        let mut update = self.grid.update(&keep);
        update.removed += left;
        update
    }

    /// The grid as of the last [`Mapper::update_grid`].
    pub fn grid(&self) -> &Grid {
        &self.grid
    }
}
