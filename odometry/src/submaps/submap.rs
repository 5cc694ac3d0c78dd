//! One submap: a grid in the frame of its root keyframe.

use crate::deskew::Point;
use nalgebra::Vector2;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::Grid;
use randt_persist::persist;

/// A submap with its grid.
#[derive(Clone, Debug)]
pub struct Submap {
    /// Number of the submap, from 0.
    pub id: u64,
    /// Keyframe at its origin.
    pub root_keyframe: u64,
    /// That keyframe's pose in `odom`.
    pub odom_from_root: Pose2,
    /// Its cells.
    pub grid: Grid,
}

persist!(Submap {
    id,
    root_keyframe,
    odom_from_root,
    grid
});

impl Submap {
    /// Empty, with a grid that never grows.
    pub fn new(config: &Config) -> Self {
        Self {
            id: 0,
            root_keyframe: 0,
            odom_from_root: Pose2::IDENTITY,
            grid: Grid::new(config.submap_extent_m(), config.cell_rule()),
        }
    }

    /// Begins anew with a root.
    pub fn open(&mut self, id: u64, root_keyframe: u64, odom_from_root: Pose2) {
        (self.id, self.root_keyframe, self.odom_from_root) = (id, root_keyframe, odom_from_root);
        self.grid.clear();
    }

    /// Distance of a pose from the root, m.
    pub fn distance_m(&self, odom_from_base: &Pose2) -> f64 {
        let root_from_base = self.odom_from_root.between(odom_from_base);
        root_from_base.translation().norm()
    }

    /// Adds a scan; gives the number of points that lie outside.
    pub fn insert(&mut self, odom_from_base: &Pose2, points: &[Point]) -> u64 {
        let root_from_base = self.odom_from_root.between(odom_from_base);
        let mut outside = 0;
        for point in points {
            let p = root_from_base.transform(Vector2::new(point.x_m, point.y_m));
            outside += u64::from(self.grid.add([p.x, p.y, point.intensity]).is_none());
        }
        self.grid.refresh();
        outside
    }
}
