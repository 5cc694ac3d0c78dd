//! How large several keys together make something: grids, and the work of a search.

use crate::Config;

/// The mapper's submaps reach this many keyframe distances of path to each side of their root:
/// enough to hold what a robot at the root sees, little enough that odometry has not drifted.
const REACH_KEYFRAMES: f64 = 8.0;

/// Squares to a side of a grid that odometry has: three of 16 MB each.
const SQUARES_MAX: f64 = 2048.0;
/// The same of the mapper's, which keeps a grid of 1 MB for every fourth keyframe.
const MAP_SQUARES_MAX: f64 = 512.0;
/// Products in one search for keyframes that look alike: a tenth of a second.
const PRODUCTS_MAX: f64 = 2e8;

/// Something whose size several keys decide, and how large it may be.
pub(crate) struct Product {
    /// The keys, as section and name.
    pub keys: Vec<(&'static str, &'static str)>,
    /// What they make.
    pub what: &'static str,
    /// How large that is.
    pub size: f64,
    /// How large it may be.
    pub most: f64,
}

impl Config {
    /// Farthest from the robot that a return of a sweep can lie once motion is removed, m, with
    /// the cell by which the squares that cut it are moved.
    pub fn scan_extent_m(&self) -> f64 {
        let moved_m = self.odometry.speed_max_m_s * self.sensor.period_s;
        self.range_used_m() + moved_m + self.cell_size_m()
    }

    /// Farthest from its root that a return of odometry's submaps can lie, m: a scan at the very
    /// edge still fits, and the speed may carry one interval beyond it.
    pub fn submap_extent_m(&self) -> f64 {
        self.range_used_m() + self.submap.radius_m + 2.0 * self.cell_size_m()
    }

    /// Path to each side of the root of a mapper's submap, m.
    pub fn map_reach_m(&self) -> f64 {
        REACH_KEYFRAMES * self.keyframe.distance_m
    }

    /// Farthest from its root that a return of a mapper's submap can lie, m.
    pub fn map_extent_m(&self) -> f64 {
        self.range_used_m() + self.map_reach_m()
    }

    /// Everything whose size depends on more than one key.
    pub(crate) fn products(&self) -> [Product; 4] {
        let grid = |what, extent_m: f64, own: &[_], most| Product {
            keys: [
                &[("filter", "range_max_m"), ("sensor", "range_max_m")],
                own,
                &[("ndt", "cell_size_m")],
            ]
            .concat(),
            what,
            size: 2.0 * extent_m / self.cell_size_m(),
            most,
        };
        let loops = &self.loops;
        let [rings, sectors, candidates] =
            [loops.rings, loops.sectors, loops.candidates].map(f64::from);
        [
            grid(
                "a scan's grid of this many squares to a side",
                self.scan_extent_m(),
                &[("odometry", "speed_max_m_s"), ("sensor", "period_s")],
                SQUARES_MAX,
            ),
            grid(
                "a submap of this many squares to a side",
                self.submap_extent_m(),
                &[("submap", "radius_m")],
                SQUARES_MAX,
            ),
            grid(
                "a submap of the map of this many squares to a side",
                self.map_extent_m(),
                &[("keyframe", "distance_m")],
                MAP_SQUARES_MAX,
            ),
            Product {
                keys: ["rings", "sectors", "candidates"]
                    .map(|key| ("loops", key))
                    .to_vec(),
                what: "a search for loops of rings x sectors^2 x candidates products",
                size: rings * sectors * sectors * candidates,
                most: PRODUCTS_MAX,
            },
        ]
    }
}
