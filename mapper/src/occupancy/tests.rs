//! The grid of hand-made keyframes: it depends on where they are, not on how they came there.

use super::*;
use crate::keyframe::Observation;
use proptest::prelude::*;
use randt_messages::{KeyframeBeam, KeyframePoint};

/// Edge of a cell, m.
const CELL_M: f64 = 0.1;

/// Beams from the origin with clusters of these (x, y, intensity).
#[derive(Clone, Debug)]
pub(super) struct Drawn(LazyObservation);

impl Drawn {
    pub(super) fn from_clusters<'a>(
        clusters: impl IntoIterator<Item = &'a [(f32, f32, f32)]>,
    ) -> Self {
        let mut drawn = Observation::default();
        for (beam, cluster) in clusters.into_iter().enumerate() {
            drawn.beams.push(KeyframeBeam {
                first_point: drawn.points.len() as u32,
                ..KeyframeBeam::default()
            });
            let point = |&(x_m, y_m, intensity): &(f32, f32, f32)| KeyframePoint {
                x_m,
                y_m,
                intensity,
                beam: beam as u16,
                reserved: 0,
            };
            drawn.points.extend(cluster.iter().map(point));
        }
        Self(drawn.into())
    }

    pub(super) fn at(&self, id: u64, pose: Pose2) -> GridKeyframe<'_> {
        GridKeyframe {
            id,
            map_from_base: pose,
            observation: &self.0,
        }
    }
}

/// Every cell that has counts, by index of cell.
fn counts(grid: &Grid) -> Vec<([i64; 2], CellCount)> {
    let edge = TILE_CELLS as i64;
    let cell = |index: TileIndex, n: usize| {
        let (column, row) = ((n % TILE_CELLS) as i64, (n / TILE_CELLS) as i64);
        [
            i64::from(index.x) * edge + column,
            i64::from(index.y) * edge + row,
        ]
    };
    grid.tiles()
        .flat_map(|(index, tile)| {
            tile.cells()
                .enumerate()
                .map(move |(n, c)| (cell(index, n), c))
        })
        .filter(|(_, count)| *count != CellCount::default())
        .collect()
}

fn grid() -> Grid {
    Grid::new(&randt_config::Grid::default())
}

fn views(keyframes: &[(u64, Drawn, Pose2)]) -> Vec<GridKeyframe<'_>> {
    keyframes
        .iter()
        .map(|(id, drawn, pose)| drawn.at(*id, *pose))
        .collect()
}

/// A grid of these keyframes, painted once.
fn painted(keyframes: &[(u64, Drawn, Pose2)]) -> Grid {
    let mut grid = grid();
    grid.update(&views(keyframes));
    grid
}

/// A wall 2 m ahead, 1 m wide.
fn wall() -> Drawn {
    let clusters: Vec<[(f32, f32, f32); 3]> = (-5..=5_i8)
        .map(|n| {
            let y_m = 0.1 * f32::from(n);
            [
                (1.98, 0.99 * y_m, 8.0),
                (2.02, 1.01 * y_m, 20.0),
                (2.2, 1.1 * y_m, 9.0),
            ]
        })
        .collect();
    Drawn::from_clusters(clusters.iter().map(<[_; 3]>::as_slice))
}

#[test]
fn a_beam_is_free_up_to_its_first_return_and_hits_at_its_strongest() {
    let beam = [(1.05, 0.05, 7.0), (1.25, 0.05, 30.0), (1.35, 0.05, 9.0)];
    let drawn = Drawn::from_clusters([beam.as_slice()]);
    let mut grid = grid();
    grid.update(&[drawn.at(0, Pose2::new(0.05, 0.0, 0.0))]);
    let counts = counts(&grid);
    let hits: Vec<i64> = counts
        .iter()
        .filter(|(_, c)| c.hits == 1)
        .map(|(cell, _)| cell[0])
        .collect();
    let misses: Vec<i64> = counts
        .iter()
        .filter(|(_, c)| c.misses == 1)
        .map(|(cell, _)| cell[0])
        .collect();
    assert_eq!(hits, [13]);
    assert_eq!(misses, (0..=10).collect::<Vec<i64>>());
    assert!(counts.iter().all(|(cell, _)| cell[1] == 0));
}

#[test]
fn a_beam_without_returns_says_nothing() {
    let drawn = Drawn::from_clusters([&[] as &[_], &[], &[]]);
    let mut grid = grid();
    assert_eq!(grid.update(&[drawn.at(0, Pose2::IDENTITY)]).added, 1);
    assert_eq!((grid.tiles().count(), grid.version()), (0, 0));
}

#[test]
fn a_keyframe_has_one_vote_a_cell_and_two_make_a_wall() {
    let wall = wall();
    let at = Pose2::new(0.05, 0.05, 0.0);
    let mut grid = grid();
    grid.update(&[wall.at(0, at)]);
    assert!(counts(&grid).iter().all(|(_, c)| c.hits + c.misses == 1));
    let state = |grid: &Grid, cell: [i64; 2]| {
        let found = counts(grid).into_iter().find(|(at, _)| *at == cell);
        grid.state(found.map_or(CellCount::default(), |(_, count)| count))
    };
    assert_eq!(state(&grid, [20, 2]), CellState::Unknown);
    grid.update(&[wall.at(1, at)]);
    assert_eq!(state(&grid, [20, 2]), CellState::Occupied);
    assert_eq!(state(&grid, [10, 1]), CellState::Free);
    assert_eq!(state(&grid, [22, 2]), CellState::Unknown);
}

#[test]
fn what_one_beam_alone_sees_through_is_no_opening() {
    let (near, far) = ([(2.05, 0.0, 9.0)], [(8.05, 0.0, 9.0)]);
    let hits = |clusters: [&[(f32, f32, f32)]; 5]| {
        let mut grid = grid();
        grid.update(&[Drawn::from_clusters(clusters).at(0, Pose2::IDENTITY)]);
        let counts = counts(&grid);
        counts
            .iter()
            .filter(|(_, c)| c.hits > 0)
            .map(|(cell, _)| cell[0])
            .collect::<Vec<i64>>()
    };
    assert_eq!(hits([&near, &near, &far, &near, &near]), [20]);
    assert_eq!(hits([&near, &far, &far, &near, &near]), [20, 80]);
    // Silence beside it speaks neither for nor against.
    assert_eq!(hits([&near, &[], &far, &[], &near]), [20, 80]);
    assert_eq!(hits([&near, &near, &far, &[], &near]), [20]);
}

#[test]
fn a_small_move_costs_nothing_and_a_nonsense_pose_takes_out() {
    let wall = wall();
    let mut grid = grid();
    grid.update(&[wall.at(7, Pose2::IDENTITY)]);
    let version = grid.version();
    let update = grid.update(&[wall.at(7, Pose2::new(0.1 * CELL_M, 0.0, 1e-4))]);
    assert_eq!((update, grid.version()), (GridUpdate::default(), version));
    let update = grid.update(&[wall.at(7, Pose2::new(0.5 * CELL_M, 0.0, 0.0))]);
    assert_eq!((update.moved, grid.version()), (1, version + 1));
    for nonsense in [Pose2::new(f64::NAN, 0.0, 0.0), Pose2::new(0.0, 1e300, 0.0)] {
        grid.update(&[wall.at(7, Pose2::IDENTITY)]);
        let update = grid.update(&[wall.at(7, nonsense)]);
        assert_eq!((update.removed, update.rejected), (1, 1));
        assert_eq!(grid.tiles().count(), 0);
    }
}

#[test]
fn only_what_changed_is_listed_again() {
    let wall = wall();
    let mut grid = grid();
    let far = Pose2::new(100.0, -50.0, 1.0);
    grid.update(&[wall.at(0, Pose2::new(3.0, 3.0, 0.0)), wall.at(1, far)]);
    let before = grid.version();
    assert!(grid.changed_since(0).count() >= 2);
    assert_eq!(grid.changed_since(before).count(), 0);
    assert_eq!(grid.remove(&[wall.at(1, far)]), 1);
    // Empty now, and listed as empty.
    assert!(grid.changed_since(before).count() >= 1);
    assert!(grid.changed_since(before).all(|(_, tile)| tile.is_none()));
    grid.update(&[wall.at(1, far)]);
    assert!(grid.changed_since(before).all(|(_, tile)| tile.is_some()));
    assert_eq!(grid.remove(&[wall.at(5, far)]), 0);
}

#[test]
fn a_tile_that_a_closure_leaves_as_it_was_is_not_listed_again() {
    let wall = wall();
    let [near, far] = [Pose2::new(3.0, 3.0, 0.0), Pose2::new(100.0, -50.0, 1.0)];
    let moved = near.compose(&Pose2::new(0.3, 0.0, 0.1));
    let mut grid = grid();
    grid.update(&[wall.at(0, near), wall.at(1, near), wall.at(2, far)]);
    let before = grid.version();
    // Two of three: painted anew as a whole.
    let update = grid.update(&[wall.at(0, moved), wall.at(1, moved), wall.at(2, far)]);
    assert_eq!(update.moved, 2);
    assert_eq!(grid.version(), before + 1);
    assert!(grid.changed_since(before).count() >= 1);
    assert!(grid.changed_since(before).all(|(index, _)| index.x < 10));
    // Away, and what it left is listed as empty.
    grid.update(&[wall.at(0, far), wall.at(1, far), wall.at(2, far)]);
    assert!(
        grid.changed_since(before + 1)
            .any(|(_, tile)| tile.is_none())
    );
    assert!(
        grid.changed_since(before + 1)
            .any(|(_, tile)| tile.is_some())
    );
}

fn any_pose() -> impl Strategy<Value = Pose2> {
    (-30.0..30.0, -30.0..30.0, -4.0..4.0).prop_map(|(x, y, yaw)| Pose2::new(x, y, yaw))
}

fn any_keyframe() -> impl Strategy<Value = Drawn> {
    let point = (-12.0_f32..12.0, -12.0_f32..12.0, 0.0_f32..50.0);
    let cluster = prop::collection::vec(point, 0..4);
    prop::collection::vec(cluster, 0..30)
        .prop_map(|clusters| Drawn::from_clusters(clusters.iter().map(Vec::as_slice)))
}

proptest! {
    #[test]
    fn the_way_to_a_pose_leaves_no_trace(
        keyframes in prop::collection::vec((any_keyframe(), any_pose(), any_pose()), 1..6),
        way in 0..3,
    ) {
        let at = |which: fn(&(Drawn, Pose2, Pose2)) -> Pose2| -> Vec<(u64, Drawn, Pose2)> {
            (0..).zip(&keyframes).map(|(id, k)| (id, k.0.clone(), which(k))).collect()
        };
        let (old, new) = (at(|k| k.1), at(|k| k.2));
        let direct = painted(&new);
        let mut moved = painted(&old);
        let mut views = views(&new);
        match way {
            0 => {
                moved.update(&views);
            }
            1 => {
                views.reverse();
                moved.update(&views);
            }
            _ => views.iter().for_each(|view| {
                moved.update(&[*view]);
            }),
        }
        prop_assert_eq!(counts(&moved), counts(&direct));
        prop_assert_eq!(moved.tiles().count(), direct.tiles().count());
        moved.remove(&views);
        prop_assert_eq!(moved.tiles().count(), 0);
    }

    #[test]
    fn any_keyframe_is_painted_or_left(
        beams in prop::collection::vec((any::<f32>(), any::<f32>(), any::<u32>()), 0..20),
        points in prop::collection::vec((any::<f32>(), any::<f32>(), any::<f32>()), 0..40),
        near in prop::bool::ANY,
    ) {
        // Bits of all kinds; half of the time small enough to be drawn.
        let bound = |v: f32| if near { v % 20.0 } else { v };
        let beams: Vec<KeyframeBeam> = beams
            .iter()
            .map(|&(x_m, y_m, first)| KeyframeBeam {
                x_m: bound(x_m),
                y_m: bound(y_m),
                azimuth_rad: 0.0,
                first_point: if near { first % 50 } else { first },
            })
            .collect();
        let points: Vec<KeyframePoint> = points
            .iter()
            .map(|&(x_m, y_m, intensity)| KeyframePoint {
                x_m: bound(x_m),
                y_m: bound(y_m),
                intensity,
                ..KeyframePoint::default()
            })
            .collect();
        let observation = Observation { beams, points }.into();
        let keyframe = GridKeyframe { id: 0, map_from_base: Pose2::IDENTITY, observation: &observation };
        let mut grid = grid();
        grid.update(&[keyframe]);
        grid.remove(&[keyframe]);
        prop_assert_eq!(grid.tiles().count(), 0);
    }
}

#[test]
fn a_map_that_has_moved_is_painted_bit_by_bit() {
    let mapper = || {
        let mut mapper = crate::Mapper::new(&randt_config::Config::default());
        for id in 0..30 {
            let mut keyframe = randt_messages::Message::<randt_messages::Keyframe>::default();
            keyframe.head.id = id;
            keyframe.head.header.stamp_ns = id as i64;
            keyframe.head.pose = [0.5 * id as f64, 0.3, 0.0];
            keyframe.head.beam_count = 2;
            keyframe.head.beams[1].first_point = 1;
            for (x_m, beam) in [(-1.0, 0), (1.0, 1)] {
                keyframe.items.push(KeyframePoint {
                    x_m,
                    y_m: 2.0,
                    intensity: 9.0,
                    beam,
                    reserved: 0,
                });
            }
            assert!(mapper.push(keyframe.as_ref()));
        }
        mapper.update_grid();
        let moved = Pose2::new(1.03, 0.7, 0.2);
        let component = crate::ComponentIdx(0);
        mapper.graph.move_component(component, &moved);
        mapper
    };
    let (mut whole, mut slices) = (mapper(), mapper());
    assert_eq!(whole.update_grid().moved, 30);
    // Each is painted twice.
    let slice = |mapper: &mut crate::Mapper| {
        let update = mapper.update_grid_by(24);
        (update.moved, update.left)
    };
    let moved = [(); 4].map(|()| slice(&mut slices));
    assert_eq!(moved, [(12, 18), (12, 6), (6, 0), (0, 0)]);
    let cells = |mapper: &crate::Mapper| {
        let tiles = mapper.grid().tiles();
        let cells = tiles.map(|(index, tile)| (index, tile.cells().collect::<Vec<_>>()));
        cells.collect::<Vec<_>>()
    };
    assert!(!cells(&whole).is_empty() && cells(&whole) == cells(&slices));
}
