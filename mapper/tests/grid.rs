//! The grid alone: keyframes of a simulated drive at their true poses must give the walls, all of
//! them, and no others.

use nalgebra::Vector2;
use randt_drives::Drive;
use randt_geometry::Pose2;
use randt_mapper::occupancy::{CellState, Grid, GridKeyframe, TILE_CELLS};
use randt_mapper::{LazyObservation, Observation};
use randt_messages::{Keyframe, Message};
use randt_simulator::{Wall, World};
use std::ops::Range;

/// Cells this near to a wall are right, m.
const NEAR_M: f64 = 0.2;
/// Walls count as seen from here to there, m: behind the radar's nearest range; beams are 0.23 m
/// apart at the farthest.
const SEEN_M: Range<f64> = 0.7..8.0;

/// A keyframe at its true pose.
struct Kept {
    keyframe: Message<Keyframe>,
    observation: LazyObservation,
    pose: Pose2,
}

impl Kept {
    fn view(&self) -> GridKeyframe<'_> {
        let head = &self.keyframe.head;
        GridKeyframe {
            id: head.id,
            map_from_base: self.pose,
            observation: &self.observation,
        }
    }
}

/// Keyframes of a drive, at their true poses.
fn drive(world: &World, seed: u64) -> Vec<Kept> {
    let mut drive = Drive::new(world, world.sweeps() / 2, seed, &[]);
    let keyframes = std::mem::take(&mut drive.keyframes).into_iter();
    keyframes
        .map(|keyframe| Kept {
            pose: drive.truth(keyframe.head.header.stamp_ns),
            observation: Observation::from_message(keyframe.as_ref()).into(),
            keyframe,
        })
        .collect()
}

fn distance_m(wall: &Wall, point: Vector2<f64>) -> f64 {
    let along = wall.to_m - wall.from_m;
    let share = ((point - wall.from_m).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (point - wall.from_m - along * share).norm()
}

/// Whether a wall lies between two points, but for their last centimetres.
fn is_hidden(walls: &[Wall], from: Vector2<f64>, to: Vector2<f64>) -> bool {
    let cross = |a: Vector2<f64>, b: Vector2<f64>| a.x * b.y - a.y * b.x;
    let ray = to - from;
    walls.iter().any(|wall| {
        let along = wall.to_m - wall.from_m;
        let area = cross(ray, along);
        let t = cross(wall.from_m - from, along) / area;
        let u = cross(wall.from_m - from, ray) / area;
        (0.0..1.0 - 0.05 / ray.norm()).contains(&t) && (0.0..=1.0).contains(&u)
    })
}

/// Middles of the cells of a state, m.
fn cells(grid: &Grid, state: CellState) -> Vec<Vector2<f64>> {
    let mut found = Vec::new();
    for (index, tile) in grid.tiles() {
        for row in 0..TILE_CELLS {
            for column in 0..TILE_CELLS {
                if grid.state(tile.cell(column, row)) == state {
                    let at = |tile: i32, cell: usize| {
                        (f64::from(tile) * TILE_CELLS as f64 + cell as f64 + 0.5)
                            * grid.cell_size_m()
                    };
                    found.push(Vector2::new(at(index.x, column), at(index.y, row)));
                }
            }
        }
    }
    found
}

/// Points on the walls that at least three keyframes saw, every 10 cm.
fn seen_walls(world: &World, keyframes: &[Kept]) -> Vec<Vector2<f64>> {
    let mut points = Vec::new();
    for wall in &world.walls {
        let along = wall.to_m - wall.from_m;
        let count = (along.norm() / 0.1).ceil().max(1.0) as usize;
        points.extend((0..count).map(|n| wall.from_m + along * ((n as f64 + 0.5) / count as f64)));
    }
    let is_seen = |point: &Vector2<f64>| {
        let sees = |kept: &&Kept| {
            let from = kept.pose.translation();
            SEEN_M.contains(&(from - point).norm()) && !is_hidden(&world.walls, from, *point)
        };
        keyframes.iter().filter(sees).count() >= 3
    };
    points.retain(is_seen);
    points
}

fn share<T>(all: &[T], holds: impl Fn(&T) -> bool) -> f64 {
    all.iter().filter(|one| holds(one)).count() as f64 / all.len().max(1) as f64
}

#[test]
fn walls_are_where_they_are_and_nowhere_else() {
    let world = World::building();
    let keyframes = drive(&world, 7);
    let mut grid = Grid::new(&randt_config::Grid::default());
    grid.update(&keyframes.iter().map(Kept::view).collect::<Vec<_>>());
    let (occupied, free) = (
        cells(&grid, CellState::Occupied),
        cells(&grid, CellState::Free),
    );
    let wall_m = |point: &Vector2<f64>| {
        let distances = world.walls.iter().map(|wall| distance_m(wall, *point));
        distances.fold(f64::INFINITY, f64::min)
    };
    let seen = seen_walls(&world, &keyframes);
    let has = |cells: &[Vector2<f64>], point: &Vector2<f64>, within_m: f64| {
        cells.iter().any(|cell| (cell - point).norm() <= within_m)
    };

    let near = share(&occupied, |cell| wall_m(cell) <= NEAR_M);
    let ys = || {
        world
            .walls
            .iter()
            .flat_map(|wall| [wall.from_m.y, wall.to_m.y])
    };
    let top_and_bottom_m =
        ys().fold(f64::INFINITY, f64::min) + ys().fold(f64::NEG_INFINITY, f64::max);
    let mirrored = share(&occupied, |cell| {
        wall_m(&Vector2::new(cell.x, top_and_bottom_m - cell.y)) <= NEAR_M
    });
    let found = share(&seen, |point| has(&occupied, point, NEAR_M));
    // Cells at a wall of which the grid says anything, and those of them that a planner would
    // drive through.
    let at_wall: Vec<_> = free
        .iter()
        .chain(&occupied)
        .filter(|cell| wall_m(cell) <= 0.06)
        .collect();
    let open = share(&at_wall, |cell| !has(&occupied, cell, 0.11));
    let driven: Vec<_> = keyframes
        .iter()
        .map(|kept| kept.pose.translation())
        .collect();
    let passable = share(&driven, |at| {
        has(&free, at, 0.1) && !has(&occupied, at, 0.1)
    });
    println!(
        "{} keyframes, {} occupied cells: {:.1} % within {NEAR_M} m of a wall (mirrored {:.1} %); of {} points of \
         walls seen {:.1} % found; of {} cells at a wall {:.1} % open; {:.1} % of the drive free",
        keyframes.len(),
        occupied.len(),
        100.0 * near,
        100.0 * mirrored,
        seen.len(),
        100.0 * found,
        at_wall.len(),
        100.0 * open,
        100.0 * passable
    );
    assert!(near >= 0.95, "{near}");
    assert!(mirrored < near - 0.1, "{mirrored}");
    assert!(found >= 0.88, "{found}");
    assert!(open <= 0.08, "{open}");
    assert!(passable >= 0.98, "{passable}");
}
