//! Submaps: the NDT cells around a root keyframe, made of the keyframes before and after it.
//!
//! A submap stands in its root's frame and uses odometry's relative poses only, and it ends where
//! they are no longer exact: the graph can move without touching it. Most keyframes are never met
//! again, so a submap is made when it is first asked for, and a mapper that comes back has none to
//! make.

use crate::index::KeyframeIdx;
use crate::keyframe::MapKeyframe;
use nalgebra::Vector2;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{Grid, ScanCell};
use std::cell::OnceCell;

/// A root at every this many keyframe distances of path: each keyframe has one within two
/// keyframes.
const SPACING_KEYFRAMES: f64 = 4.0;
/// A submap or query ends where odometry has added this standard deviation since its root, m: a
/// loop vouches for half a metre. Over the four metres that it reaches, building and yard add 0.04
/// to 0.10, a tunnel up to 0.12, bare corridors and rings 0.15 to 1.7; there they are off by 0.3
/// to 10 m. At 0.125 two of six hard drives keep a false loop.
const DRIFT_MAX_M: f64 = 0.1;

/// NDT cells in the frame of a root keyframe.
#[derive(Clone, Debug)]
struct Submap {
    root: KeyframeIdx,
    /// The cells, from when they were first asked for.
    grid: OnceCell<Grid>,
}

/// All submaps, and the rule by which keyframes enter them.
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

    /// Takes the newest keyframe: it enters the submaps that reach it, and becomes a root where
    /// the last one is far.
    pub fn push(&mut self, keyframes: &[MapKeyframe]) {
        let Some((newest, keyframe)) = keyframes.len().checked_sub(1).zip(keyframes.last()) else {
            return;
        };
        for submap in self.submaps.iter_mut().rev() {
            let root = keyframes.get(submap.root.0);
            let Some(root) = root.filter(|root| connected(root, keyframe, self.reach_m)) else {
                break;
            };
            if let Some(grid) = submap.grid.get_mut()
                && is_rigid(root, keyframe, self.reach_m)
            {
                insert(grid, root, keyframe);
                grid.refresh();
            }
        }
        let last = self.submaps.last();
        let root = last.and_then(|submap| keyframes.get(submap.root.0));
        if !root.is_some_and(|root| connected(root, keyframe, self.spacing_m)) {
            self.submaps.push(Submap {
                root: KeyframeIdx(newest),
                grid: OnceCell::new(),
            });
        }
    }

    /// Path from a keyframe within which the submap that is asked for by it may have others, m.
    pub fn reach_m(&self) -> f64 {
        self.reach_m + self.spacing_m
    }

    /// Forgets the cells around a root that no keyframe of the graph asks for any more.
    pub fn forget(&mut self, root: KeyframeIdx) {
        let index = (self.submaps).binary_search_by_key(&root, |submap| submap.root);
        if let Some(submap) = index.ok().and_then(|index| self.submaps.get_mut(index)) {
            submap.grid = OnceCell::new();
        }
    }

    /// The root of the submap that is nearest along the path to a keyframe of the same frame.
    pub fn root_of(
        &self,
        keyframe: &MapKeyframe,
        keyframes: &[MapKeyframe],
    ) -> Option<KeyframeIdx> {
        let root = |submap: &Submap| keyframes.get(submap.root.0);
        let is_before = |root: &MapKeyframe| root.path_m <= keyframe.path_m;
        let is_passed = |submap: &Submap| root(submap).is_some_and(is_before);
        let after = self.submaps.partition_point(is_passed);
        let near = after.saturating_sub(1)..(after + 1).min(self.submaps.len());
        let distances = self.submaps.get(near)?.iter().filter_map(|submap| {
            let root = root(submap).filter(|it| it.odom_frame_id == keyframe.odom_frame_id)?;
            Some(((root.path_m - keyframe.path_m).abs(), submap.root))
        });
        let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, root)| root)
    }

    /// The cells of the submap with this root.
    pub fn grid(&self, root: KeyframeIdx, keyframes: &[MapKeyframe]) -> Option<&Grid> {
        let submaps = &self.submaps;
        let index = submaps.binary_search_by_key(&root, |submap| submap.root);
        let submap = submaps.get(index.ok()?)?;
        Some(submap.grid.get_or_init(|| self.build(root, keyframes)))
    }

    /// The roots of all of them, rising.
    pub fn roots(&self) -> impl Iterator<Item = KeyframeIdx> {
        self.submaps.iter().map(|submap| submap.root)
    }

    /// Whether one of the scans of the submap with this root saw every direction by itself.
    pub fn sees_all(&self, root: KeyframeIdx, keyframes: &[MapKeyframe]) -> bool {
        self.members(root, keyframes).any(|member| member.sees_all)
    }

    /// The cells around a root.
    fn build(&self, root: KeyframeIdx, keyframes: &[MapKeyframe]) -> Grid {
        let mut grid = self.empty.clone();
        if let Some(keyframe) = keyframes.get(root.0) {
            for member in self.members(root, keyframes) {
                insert(&mut grid, keyframe, member);
            }
        }
        grid.refresh();
        grid
    }

    /// The keyframes around a root: backwards from it, then onwards, as those that come later will
    /// enter.
    fn members<'a>(
        &self,
        root: KeyframeIdx,
        keyframes: &'a [MapKeyframe],
    ) -> impl Iterator<Item = &'a MapKeyframe> + use<'a> {
        let reach_m = self.reach_m;
        let (before, after) = keyframes.split_at_checked(root.0 + 1).unwrap_or_default();
        let keyframe = before.last();
        let is_member = move |other: &&MapKeyframe| {
            keyframe.is_some_and(|keyframe| is_rigid(keyframe, other, reach_m))
        };
        let onwards = after.iter().take_while(is_member);
        before.iter().rev().take_while(is_member).chain(onwards)
    }
}

/// What a robot has just driven through, in the frame of the newest keyframe: it is registered
/// against old submaps.
///
/// A single scan of a sparse radar looks like many spots; the last metres look like one.
#[derive(Clone, Debug)]
pub struct QuerySubmap {
    /// The cells, for the comparison backwards.
    pub grid: Grid,
    /// The same cells, for the comparison forwards.
    pub cells: Vec<ScanCell>,
    /// Whether one of its scans saw every direction by itself.
    pub sees_all: bool,
    reach_m: f64,
}

impl QuerySubmap {
    /// Empty.
    pub fn new(config: &Config) -> Self {
        Self {
            grid: local_grid(config),
            cells: Vec::new(),
            sees_all: false,
            reach_m: config.map_reach_m(),
        }
    }

    /// The query that ends at the last of `keyframes`.
    pub fn build(&mut self, keyframes: &[MapKeyframe]) {
        self.grid.clear();
        self.sees_all = false;
        if let Some(newest) = keyframes.last() {
            let reached = |other: &&MapKeyframe| is_rigid(newest, other, self.reach_m);
            for keyframe in keyframes.iter().rev().take_while(reached) {
                self.sees_all |= keyframe.sees_all;
                insert(&mut self.grid, newest, keyframe);
            }
        }
        self.grid.refresh();
        self.cells.clear();
        let cells = self.grid.cells().map(|cell| ScanCell::new(cell, 0.0));
        self.cells.extend(cells);
    }
}

/// An empty grid for what is seen within a reach of path.
fn local_grid(config: &Config) -> Grid {
    Grid::new(config.map_extent_m(), config.cell_rule())
}

/// Whether odometry connects two keyframes within a reach of path.
fn connected(a: &MapKeyframe, b: &MapKeyframe, reach_m: f64) -> bool {
    a.odom_frame_id == b.odom_frame_id && (a.path_m - b.path_m).abs() <= reach_m
}

/// Whether it does so exactly enough for one rigid body.
fn is_rigid(a: &MapKeyframe, b: &MapKeyframe, reach_m: f64) -> bool {
    connected(a, b, reach_m) && (a.drift_m2 - b.drift_m2).abs() <= DRIFT_MAX_M * DRIFT_MAX_M
}

fn insert(grid: &mut Grid, root: &MapKeyframe, keyframe: &MapKeyframe) {
    let relative: Pose2 = root.odom_from_base.between(&keyframe.odom_from_base);
    for point in &keyframe.observation.points {
        let p = relative.transform(Vector2::new(f64::from(point.x_m), f64::from(point.y_m)));
        grid.add([p.x, p.y, f64::from(point.intensity)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keyframe::{LazyObservation, Observation};
    use nalgebra::Matrix3;
    use randt_messages::KeyframePoint;

    /// A keyframe every half metre along x that sees a wall two metres to its left; the frame
    /// changes at keyframe 30.
    fn drive() -> Vec<MapKeyframe> {
        let keyframe = |i: u32| MapKeyframe {
            keyframe_id: u64::from(i),
            stamp_ns: i64::from(i),
            odom_frame_id: u64::from(i >= 30),
            submap_root: 0,
            odom_from_base: Pose2::new(0.5 * f64::from(i), 0.0, 0.0),
            step_covariance: Matrix3::identity(),
            speed_m_s: 1.0,
            turn_rad_s: 0.0,
            path_m: 0.5 * f64::from(i),
            drift_m2: 1e-4 * f64::from(i),
            sees_all: i.is_multiple_of(20),
            observation: LazyObservation::from(Observation {
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
        (0..60).map(keyframe).collect()
    }

    fn points(grid: &Grid) -> u32 {
        let slots = (0..grid.occupied()).filter_map(|square| grid.distribution(square));
        slots.map(|sum| sum.count).sum()
    }

    #[test]
    fn a_submap_holds_what_is_near_along_the_path_and_of_its_frame() {
        let keyframes = drive();
        let mut submaps = Submaps::new(&Config::default());
        for end in 1..=keyframes.len() {
            submaps.push(&keyframes[..end]);
        }
        let roots: Vec<usize> = submaps.roots().map(|root| root.0).collect();
        assert_eq!(roots[..4], [0, 5, 10, 15]);
        assert!(roots.contains(&30), "a new frame begins with a root");
        // Eight keyframes to each side and itself.
        assert_eq!(
            points(submaps.grid(KeyframeIdx(15), &keyframes).unwrap()),
            17 * 40
        );
        // Only its own frame: nothing before, eight after.
        assert_eq!(
            points(submaps.grid(KeyframeIdx(30), &keyframes).unwrap()),
            9 * 40
        );
        assert_eq!(
            submaps.root_of(&keyframes[12], &keyframes),
            Some(KeyframeIdx(10))
        );
        assert_eq!(
            submaps.root_of(&keyframes[29], &keyframes),
            Some(KeyframeIdx(25))
        );
        assert!(submaps.grid(KeyframeIdx(3), &keyframes).is_none());
    }

    #[test]
    fn a_submap_is_the_same_whenever_it_is_first_asked_for() {
        let keyframes = drive();
        let cells = |asked: usize| {
            let mut submaps = Submaps::new(&Config::default());
            for end in 1..=keyframes.len() {
                submaps.push(&keyframes[..end]);
                if end == asked {
                    submaps.grid(KeyframeIdx(15), &keyframes[..end]).unwrap();
                }
            }
            let grid = submaps.grid(KeyframeIdx(15), &keyframes).unwrap();
            grid.cells().copied().collect::<Vec<_>>()
        };
        for asked in 16..30 {
            assert_eq!(cells(asked), cells(60), "asked for at {asked}");
        }
    }

    #[test]
    fn submaps_and_queries_end_where_odometry_drifts() {
        let mut keyframes = drive();
        // Between keyframes 12 and 13 the robot drove blind: 0.11 m of standard deviation.
        for keyframe in keyframes.iter_mut().skip(13) {
            keyframe.drift_m2 += 0.0121;
        }
        let mut submaps = Submaps::new(&Config::default());
        for end in 1..=keyframes.len() {
            submaps.push(&keyframes[..end]);
            // One that is there before what it may not take comes.
            if end == 12 {
                submaps.grid(KeyframeIdx(10), &keyframes[..end]).unwrap();
            }
        }
        let counted = |root| points(submaps.grid(KeyframeIdx(root), &keyframes).unwrap()) / 40;
        // Eight before and two after; of 15, two before and eight after.
        assert_eq!((counted(10), counted(15)), (11, 11));
        let mut query = QuerySubmap::new(&Config::default());
        query.build(&keyframes[..=15]);
        assert_eq!(points(&query.grid), 3 * 40);
    }

    #[test]
    fn what_no_scan_saw_a_submap_does_not_see() {
        // Keyframes 0, 20 and 40 saw every direction.
        let keyframes = drive();
        let mut submaps = Submaps::new(&Config::default());
        let mut query = QuerySubmap::new(&Config::default());
        for end in 1..=keyframes.len() {
            submaps.push(&keyframes[..end]);
            query.build(&keyframes[..end]);
            assert_eq!(query.sees_all, matches!(end - 1, 0..=8 | 20..=28 | 40..=48));
        }
        let sees = |root| submaps.sees_all(KeyframeIdx(root), &keyframes);
        assert!(sees(0) && sees(5) && !sees(10) && sees(15) && sees(20));
        // 22 keyframes away: another frame's does not count.
        assert!(!sees(30));
    }

    #[test]
    fn a_query_submap_is_the_last_metres_seen_from_its_end() {
        let keyframes = drive();
        let mut query = QuerySubmap::new(&Config::default());
        query.build(&keyframes[..33]);
        assert_eq!(points(&query.grid), 3 * 40);
        query.build(&keyframes[..=20]);
        assert_eq!(points(&query.grid), 9 * 40);
        // The wall lies to the left, most of it behind.
        assert!(
            query
                .cells
                .iter()
                .all(|c| (c.cell.mean[1] - 2.0).abs() < 0.1)
        );
        assert!(query.cells.iter().any(|c| c.cell.mean[0] < -4.0));
    }
}
