//! Submaps: the NDT cells around a root keyframe, made of the keyframes before and after it.
//!
//! A submap stands in its root's frame and uses odometry's relative poses only, which are exact over its few metres:
//! the graph can move without touching it. Most places are never met again, so a submap is made when it is first asked
//! for, and a mapper that comes back has none to make.

use crate::Place;
use nalgebra::Vector2;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{Grid, ScanCell};
use std::cell::OnceCell;

/// A root every so many keyframe distances of path: each place has one within two keyframes.
const SPACING_KEYFRAMES: f64 = 4.0;

/// NDT cells in the frame of a root keyframe.
#[derive(Clone, Debug)]
struct Submap {
    /// Index of the root place.
    root: usize,
    /// The cells, from when they were first asked for.
    grid: OnceCell<Grid>,
}

/// All submaps, and the rule by which places enter them.
#[derive(Clone, Debug)]
pub struct Submaps {
    submaps: Vec<Submap>,
    reach_m: f64,
    spacing_m: f64,
    empty: Grid,
}

impl Submaps {
    /// None yet.
    pub fn new(config: &Config) -> Self {
        Self {
            submaps: Vec::new(),
            reach_m: config.map_reach_m(),
            spacing_m: SPACING_KEYFRAMES * config.keyframe.distance_m,
            empty: local_grid(config),
        }
    }

    /// Takes the newest place: it enters the submaps that reach it, and becomes a root where the last one is far.
    pub fn push(&mut self, places: &[Place]) {
        let Some((newest, place)) = places.len().checked_sub(1).zip(places.last()) else {
            return;
        };
        for submap in self.submaps.iter_mut().rev() {
            let Some(root) = places.get(submap.root) else {
                break;
            };
            if !connected(root, place, self.reach_m) {
                break;
            }
            if let Some(grid) = submap.grid.get_mut() {
                insert(grid, root, place);
                grid.refresh();
            }
        }
        let last_root = self
            .submaps
            .last()
            .and_then(|submap| places.get(submap.root));
        if !last_root.is_some_and(|root| connected(root, place, self.spacing_m)) {
            self.submaps.push(Submap {
                root: newest,
                grid: OnceCell::new(),
            });
        }
    }

    /// The root of the submap that is nearest along the path to a place of the same frame.
    pub fn root_of(&self, place: &Place, places: &[Place]) -> Option<usize> {
        let after = self.submaps.partition_point(|submap| {
            places
                .get(submap.root)
                .is_some_and(|root| root.path_m <= place.path_m)
        });
        let near = self
            .submaps
            .get(after.saturating_sub(1)..(after + 1).min(self.submaps.len()))?;
        let distance = |submap: &&Submap| {
            places
                .get(submap.root)
                .filter(|root| root.odom_frame_id == place.odom_frame_id)
                .map_or(f64::INFINITY, |root| (root.path_m - place.path_m).abs())
        };
        near.iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .filter(|submap| distance(submap).is_finite())
            .map(|submap| submap.root)
    }

    /// The cells of the submap with this root.
    pub fn grid(&self, root: usize, places: &[Place]) -> Option<&Grid> {
        let index = self
            .submaps
            .binary_search_by_key(&root, |submap| submap.root);
        let submap = self.submaps.get(index.ok()?)?;
        Some(submap.grid.get_or_init(|| self.made(root, places)))
    }

    /// The roots of all of them, rising.
    pub fn roots(&self) -> impl Iterator<Item = usize> {
        self.submaps.iter().map(|submap| submap.root)
    }

    /// The cells around a root: backwards from it, then onwards, as the places that come later will enter.
    fn made(&self, root: usize, places: &[Place]) -> Grid {
        let mut grid = self.empty.clone();
        let (before, after) = places.split_at_checked(root + 1).unwrap_or_default();
        if let Some(place) = before.last() {
            let reached = |other: &&Place| connected(place, other, self.reach_m);
            let onwards = after.iter().take_while(reached);
            for other in before.iter().rev().take_while(reached).chain(onwards) {
                insert(&mut grid, place, other);
            }
        }
        grid.refresh();
        grid
    }
}

/// What a robot has just driven through, in the frame of the newest keyframe: the scan that is compared with submaps.
///
/// A single scan of a sparse radar looks like many places; the last metres look like one.
#[derive(Clone, Debug)]
pub struct Trail {
    /// The cells, for the comparison backwards.
    pub grid: Grid,
    /// The same cells, for the comparison forwards.
    pub cells: Vec<ScanCell>,
    reach_m: f64,
}

impl Trail {
    /// Empty.
    pub fn new(config: &Config) -> Self {
        Self {
            grid: local_grid(config),
            cells: Vec::new(),
            reach_m: config.map_reach_m(),
        }
    }

    /// The trail that ends at the last of `places`.
    pub fn follow(&mut self, places: &[Place]) {
        self.grid.clear();
        if let Some(newest) = places.last() {
            for place in places.iter().rev() {
                if !connected(newest, place, self.reach_m) {
                    break;
                }
                insert(&mut self.grid, newest, place);
            }
        }
        self.grid.refresh();
        self.cells.clear();
        self.cells
            .extend(self.grid.cells().map(|cell| ScanCell::new(cell, 0.0)));
    }
}

/// An empty grid for what is seen within a reach of path.
fn local_grid(config: &Config) -> Grid {
    Grid::new(config.map_extent_m(), config.cell_rule())
}

/// Whether odometry joins two places within so much path.
fn connected(a: &Place, b: &Place, reach_m: f64) -> bool {
    a.odom_frame_id == b.odom_frame_id && (a.path_m - b.path_m).abs() <= reach_m
}

fn insert(grid: &mut Grid, root: &Place, place: &Place) {
    let relative: Pose2 = root.odom.between(&place.odom);
    for point in &place.sight.points {
        let p = relative.transform(Vector2::new(f64::from(point.x_m), f64::from(point.y_m)));
        grid.add([p.x, p.y, f64::from(point.intensity)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LazySight, Sight};
    use nalgebra::Matrix3;
    use randt_messages::KeyframePoint;

    /// A keyframe every half metre along x that sees a wall two metres to its left; the frame changes at place 30.
    fn drive() -> Vec<Place> {
        let place = |i: u32| Place {
            keyframe_id: u64::from(i),
            stamp_ns: i64::from(i),
            odom_frame_id: u64::from(i >= 30),
            submap_root: 0,
            odom: Pose2::new(0.5 * f64::from(i), 0.0, 0.0),
            step_covariance: Matrix3::identity(),
            speed_m_s: 1.0,
            path_m: 0.5 * f64::from(i),
            sight: LazySight::from(Sight {
                beams: Vec::new(),
                points: (0..40)
                    .map(|k| KeyframePoint {
                        x_m: 0.1 * k as f32 - 2.0,
                        y_m: 2.0 + 0.01 * (k % 4) as f32,
                        intensity: 9.0 + (k % 3) as f32,
                        beam: 0,
                        reserved: 0,
                    })
                    .collect(),
            }),
        };
        (0..60).map(place).collect()
    }

    fn points(grid: &Grid) -> u32 {
        let slots = (0..grid.occupied()).filter_map(|square| grid.distribution(square));
        slots.map(|sum| sum.count).sum()
    }

    #[test]
    fn a_submap_holds_what_is_near_along_the_path_and_of_its_frame() {
        let places = drive();
        let mut submaps = Submaps::new(&Config::default());
        for end in 1..=places.len() {
            submaps.push(&places[..end]);
        }
        let roots: Vec<usize> = submaps.roots().collect();
        assert_eq!(roots[..4], [0, 5, 10, 15]);
        assert!(roots.contains(&30), "a new frame begins with a root");
        // Eight keyframes to each side and itself.
        assert_eq!(points(submaps.grid(15, &places).unwrap()), 17 * 40);
        // Only its own frame: nothing before, eight after.
        assert_eq!(points(submaps.grid(30, &places).unwrap()), 9 * 40);
        assert_eq!(submaps.root_of(&places[12], &places), Some(10));
        assert_eq!(submaps.root_of(&places[29], &places), Some(25));
        assert!(submaps.grid(3, &places).is_none());
    }

    #[test]
    fn a_submap_is_the_same_whenever_it_is_first_asked_for() {
        let places = drive();
        let cells = |asked: usize| {
            let mut submaps = Submaps::new(&Config::default());
            for end in 1..=places.len() {
                submaps.push(&places[..end]);
                if end == asked {
                    submaps.grid(15, &places[..end]).unwrap();
                }
            }
            let grid = submaps.grid(15, &places).unwrap();
            grid.cells().copied().collect::<Vec<_>>()
        };
        for asked in 16..30 {
            assert_eq!(cells(asked), cells(60), "asked for at {asked}");
        }
    }

    #[test]
    fn a_trail_is_the_last_metres_seen_from_its_end() {
        let places = drive();
        let mut trail = Trail::new(&Config::default());
        trail.follow(&places[..33]);
        assert_eq!(points(&trail.grid), 3 * 40);
        trail.follow(&places[..=20]);
        assert_eq!(points(&trail.grid), 9 * 40);
        // The wall lies to the left, most of it behind.
        assert!(
            trail
                .cells
                .iter()
                .all(|c| (c.cell.mean[1] - 2.0).abs() < 0.1)
        );
        assert!(trail.cells.iter().any(|c| c.cell.mean[0] < -4.0));
    }
}
