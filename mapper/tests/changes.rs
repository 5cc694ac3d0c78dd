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

/// Laps before a crate is moved and laps after, and laps that a place keeps.
fn crate_is_moved(before: u32, after: u32, laps_max: u32) {
    let worlds = CRATES_M.map(hall);
    let scans = |laps: u32| (f64::from(laps) * LAP_SCANS) as u64;
    let drive = Drive::through_change(
        [&worlds[0], &worlds[1]],
        scans(before),
        scans(before + after),
        1,
    );
    let mut config = config(&worlds[0]);
    config.loops.laps_max = laps_max;
    let mut mapper = Mapper::new(&config);
    let first = drive.truth(drive.keyframes[0].head.header.stamp_ns);
    let crates = |mapper: &Mapper| {
        let world_from_map = first.compose(&mapper.poses()[0].inverse());
        CRATES_M.map(|it| occupied(mapper.grid(), it, &world_from_map))
    };
    let (mut lap, lap_m) = (0, lap_m(&worlds[0]));
    let mut seen = Vec::new();
    for keyframe in &drive.keyframes {
        mapper.push(keyframe.as_ref());
        if (mapper.path_m() / lap_m) as usize > lap {
            lap += 1;
            mapper.update_grid();
            let cells = crates(&mapper);
            println!("lap {lap}: {cells:?} cells");
            seen.push(cells);
        }
    }
    mapper.finish();
    let cells = crates(&mapper);
    let last_m = mapper.path_m() - lap_m;
    let new_lap = |index: KeyframeIdx| mapper.keyframes()[index.0].path_m > last_m;
    let found = mapper.found().filter(|it| new_lap(it.newer)).count();
    let nodes = (0..mapper.keyframes().len()).filter(|it| mapper.is_node(KeyframeIdx(*it)));
    let nodes = nodes.count();
    println!("{cells:?} cells, {found} loops in the last lap, {nodes} nodes");
    let first = seen[before as usize - 1];
    assert!(first[0] > 8 && first[1] == 0, "{first:?}");
    assert!(cells[0] <= first[0] / 10 && cells[1] > 8, "{cells:?}");
    assert!(found > 30, "{found} loops");
}

#[test]
fn a_crate_that_is_moved_stands_where_it_is_now() {
    crate_is_moved(2, 3, 1);
}

#[test]
#[ignore = "a minute: the long form"]
fn a_crate_that_is_moved_after_ten_laps_stands_where_it_is_now() {
    crate_is_moved(10, 4, 3);
}
