//! Submaps: the grids that scans are registered to, opened and closed by distance, overlapping.

use crate::{deskew::Point, slot::cell_rule};
use nalgebra::Vector2;
use randt_config::{Config, Submap as SubmapConfig};
use randt_geometry::Pose2;
use randt_ndt::Grid;
use randt_persist::persist;

/// One submap; its grid stands in the frame of its root keyframe.
#[derive(Clone, Debug)]
pub struct Submap {
    /// Number of the submap, from 0.
    pub id: u64,
    /// Keyframe at its origin.
    pub root_keyframe: u64,
    /// That keyframe's pose in `odom`.
    pub root: Pose2,
    /// Its cells.
    pub grid: Grid,
}

persist!(Submap {
    id,
    root_keyframe,
    root,
    grid
});

impl Submap {
    fn open(&mut self, id: u64, root_keyframe: u64, root: Pose2) {
        (self.id, self.root_keyframe, self.root) = (id, root_keyframe, root);
        self.grid.clear();
    }

    /// Adds a scan; gives the number of points that lie outside.
    fn insert(&mut self, pose: &Pose2, points: &[Point]) -> u64 {
        let relative = self.root.between(pose);
        let mut outside = 0;
        for point in points {
            let p = relative.transform(Vector2::new(point.x_m, point.y_m));
            outside += u64::from(self.grid.add([p.x, p.y, point.intensity]).is_none());
        }
        self.grid.refresh();
        outside
    }
}

/// The submap in force and, near its end, the one that follows; both hold the scans of the overlap.
#[derive(Clone, Debug)]
pub struct Submaps {
    config: SubmapConfig,
    active: Submap,
    next: Submap,
    next_is_open: bool,
    ids: u64,
    /// Points that fell outside of a grid.
    pub outside: u64,
}

persist!(Submaps {
    active,
    next,
    next_is_open,
    ids,
    outside,
} kept {
    config,
} sound has_room);

impl Submaps {
    /// Both grids, empty; nothing is allocated later.
    pub fn new(config: &Config) -> Self {
        // Made twice: a clone would have no room beyond what it holds.
        let submap = || Submap {
            id: 0,
            root_keyframe: 0,
            root: Pose2::IDENTITY,
            grid: Grid::new(config.submap_extent_m(), cell_rule(config)),
        };
        Self {
            config: config.submap.clone(),
            active: submap(),
            next: submap(),
            next_is_open: false,
            ids: 0,
            outside: 0,
        }
    }

    /// Whether there are numbers left.
    fn has_room(&self) -> bool {
        self.ids.max(self.outside) <= u64::MAX / 2
    }

    /// Begins anew with a root; numbers of submaps go on.
    pub fn restart(&mut self, root_keyframe: u64, root: Pose2) {
        self.active.open(self.ids, root_keyframe, root);
        self.ids += 1;
        self.close_next();
    }

    /// The root in force has another number than was thought: no keyframe was made yet.
    pub fn renumber_root(&mut self, root_keyframe: u64) {
        self.active.root_keyframe = root_keyframe;
    }

    /// Number of the next submap.
    pub fn next_id(&self) -> u64 {
        self.ids
    }

    /// Numbers go on from here.
    pub fn continue_from(&mut self, next_id: u64) {
        self.ids = next_id;
    }

    /// The submap that scans are registered to.
    pub fn active(&self) -> &Submap {
        &self.active
    }

    /// Empties the submap in force and fills it with one scan: the map before any scan is final.
    pub fn seed(&mut self, pose: &Pose2, points: &[Point]) {
        self.active.grid.clear();
        self.active.insert(pose, points);
    }

    /// Opens the next submap at a keyframe where the overlap begins.
    pub fn open_next(&mut self, keyframe: u64, pose: &Pose2) {
        let travelled = self.active.root.between(pose).translation().norm();
        if !self.next_is_open && travelled >= self.config.radius_m - self.config.overlap_m {
            self.next.open(self.ids, keyframe, *pose);
            self.ids += 1;
            self.next_is_open = true;
        }
    }

    /// Adds a scan with its final pose to every open submap; hands over where the active one ends.
    pub fn insert(&mut self, pose: &Pose2, points: &[Point]) {
        self.outside += self.active.insert(pose, points);
        if self.next_is_open {
            self.outside += self.next.insert(pose, points);
            if self.active.root.between(pose).translation().norm() >= self.config.radius_m {
                core::mem::swap(&mut self.active, &mut self.next);
                self.close_next();
            }
        }
    }

    /// Emptied at once: what is not looked at any more must not be saved.
    fn close_next(&mut self) {
        self.next.grid.clear();
        self.next_is_open = false;
    }
}
