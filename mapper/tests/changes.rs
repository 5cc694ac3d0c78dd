//! A place whose content changes: the newest state wins, in the grid and in loops.

use crate::growth::{HALL, lap_m};
use randt_drives::{Drive, config};
use randt_geometry::Pose2;
use randt_mapper::occupancy::{CellState, Grid, TILE_CELLS};
use randt_mapper::{KeyframeIdx, Mapper};
use randt_simulator::World;

/// Left, bottom, width and depth of a crate, m: where it stood, and where it is moved to.
const CRATES_M: [[f64; 4]; 2] = [[3.0, 3.2, 0.8, 0.8], [9.2, 4.4, 0.6, 0.6]];
/// Sweeps of a lap.
const LAP_SCANS: f64 = 300.0;
/// Between two sweeps.
const SCAN_NS: i64 = 200_000_000;

fn hall([x, y, width, depth]: [f64; 4]) -> World {
    let crate_there = format!("block metal {x},{y} {width}x{depth}\n");
    World::parse("hall", &format!("{HALL}{crate_there}")).unwrap()
}

/// How many cells within 0.2 m of a crate count as occupied, where `world_from_map` has them.
fn occupied(grid: &Grid, [x, y, width, depth]: [f64; 4], world_from_map: &Pose2) -> usize {
    let is_there = |at: nalgebra::Vector2<f64>| {
        let (dx, dy) = (at.x - x, at.y - y);
        (-0.2..width + 0.2).contains(&dx) && (-0.2..depth + 0.2).contains(&dy)
    };
    let edge = TILE_CELLS as i32;
    let tiles = grid.tiles().flat_map(|(index, tile)| {
        tile.cells().enumerate().map(move |(cell, count)| {
            let (column, row) = ((cell % TILE_CELLS) as i32, (cell / TILE_CELLS) as i32);
            let middle = [index.x * edge + column, index.y * edge + row].map(f64::from);
            (middle.map(|it| (it + 0.5) * grid.cell_size_m()), count)
        })
    });
    tiles
        .filter(|(at, count)| {
            let at = world_from_map.transform(nalgebra::Vector2::from(*at));
            is_there(at) && grid.state(*count) == CellState::Occupied
        })
        .count()
}

/// Passes of the changed place within which the newest state wins.
const PASSES: usize = 3;

/// Laps before a crate is moved, and laps that a place keeps.
fn crate_is_moved(before: u32, laps_max: u32) {
    let worlds = CRATES_M.map(hall);
    let scans = |laps: f64| (laps * LAP_SCANS) as u64;
    let before = scans(f64::from(before));
    let after = scans(PASSES as f64 + 1.0);
    let drive = Drive::through_change([&worlds[0], &worlds[1]], before, before + after, 1);
    let mut config = config(&worlds[0]);
    config.loops.laps_max = laps_max;
    let mut mapper = Mapper::new(&config);
    let first_ns = drive.keyframes[0].head.header.stamp_ns;
    let (first, changed_ns) = (drive.truth(first_ns), first_ns + before as i64 * SCAN_NS);
    let crates = |mapper: &mut Mapper| {
        mapper.update_grid();
        let world_from_map = first.compose(&mapper.poses()[0].inverse());
        CRATES_M.map(|it| occupied(mapper.grid(), it, &world_from_map))
    };
    let lap_m = lap_m(&worlds[0]);
    let mut changed_m = f64::INFINITY;
    // As it was before, and after each pass.
    let mut seen = Vec::new();
    for keyframe in &drive.keyframes {
        if changed_m.is_infinite() && keyframe.head.header.stamp_ns > changed_ns {
            changed_m = mapper.path_m();
            seen.push(crates(&mut mapper));
        }
        mapper.push(keyframe.as_ref());
        if mapper.path_m() >= changed_m + lap_m * seen.len() as f64 {
            seen.push(crates(&mut mapper));
        }
    }
    mapper.finish();
    let last_m = mapper.path_m() - lap_m;
    let new_lap = |index: KeyframeIdx| mapper.keyframes()[index.0].path_m > last_m;
    let found = mapper.found().filter(|it| new_lap(it.newer)).count();
    let nodes = (0..mapper.keyframes().len()).filter(|it| mapper.is_node(KeyframeIdx(*it)));
    let nodes = nodes.count();
    println!("{seen:?} cells, {found} loops in the last lap, {nodes} nodes");
    let [there, gone] = [seen[0], seen[PASSES]];
    assert!(there[0] > 8 && there[1] == 0, "{there:?}");
    assert!(gone[0] <= there[0] / 10 && gone[1] > 8, "{gone:?}");
    assert!(found > 30, "{found} loops");
}

#[test]
fn a_crate_that_is_moved_stands_where_it_is_now() {
    crate_is_moved(2, 1);
}

#[test]
#[ignore = "a minute: the long form"]
fn a_crate_that_is_moved_after_ten_laps_stands_where_it_is_now() {
    crate_is_moved(10, 3);
}
