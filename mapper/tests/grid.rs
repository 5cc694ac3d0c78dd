//! The grid alone: keyframes of a simulated drive at their true poses must give the walls, all of them, and no others.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use nalgebra::Vector2;
use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_mapper::grid::{CellState, Grid, GridKeyframe, TILE_CELLS};
use randt_messages::{
    Keyframe, KeyframeBeam, KeyframePoint, Message, MessageRef, OdometryState, RadarPoints,
};
use randt_odometry::{Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, Wall, World};
use std::collections::BTreeMap;

/// Once around the route.
const SCANS: u64 = 450;
/// Cells this near to a wall are right, m.
const NEAR_M: f64 = 0.2;
/// Walls are looked for up to here, m: beams are 0.23 m apart there.
const SEEN_M: f64 = 8.0;

/// A keyframe as the mapper keeps it, at its true pose.
struct Kept {
    id: u64,
    pose: Pose2,
    beams: Vec<KeyframeBeam>,
    points: Vec<KeyframePoint>,
}

impl Kept {
    fn view(&self) -> GridKeyframe<'_> {
        GridKeyframe {
            id: self.id,
            pose: self.pose,
            beams: &self.beams,
            points: &self.points,
        }
    }
}

/// Keyframes as they come, with the stamp of each.
#[derive(Default)]
struct Keep {
    keyframes: Vec<(i64, Kept)>,
}

impl Sink for Keep {
    fn state(&mut self, _: &OdometryState) {}
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        let head = keyframe.head;
        let kept = Kept {
            id: head.id,
            pose: Pose2::IDENTITY,
            beams: head.beams[..head.beam_count as usize].to_vec(),
            points: keyframe.items.to_vec(),
        };
        self.keyframes.push((head.header.stamp_ns, kept));
    }
}

/// Keyframes of a drive, at their true poses.
fn drive(world: &World, seed: u64) -> Vec<Kept> {
    let robot = Robot::default();
    let mut config = Config::default();
    config.robot.radar_x_m = robot.radar_mounting.x_m;
    config.robot.radar_y_m = robot.radar_mounting.y_m;
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(&config, true);
    let (mut keep, mut truth) = (Keep::default(), BTreeMap::new());
    for event in Simulation::new(world, robot, SCANS, seed) {
        match event {
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut keep);
            }
            Event::Imu(sample) => odometry.push_imu(&sample, &mut keep),
            Event::Truth(pose) => {
                truth.insert(pose.header.stamp_ns, Pose2::from_array(pose.pose));
            }
        }
    }
    odometry.finish(&mut keep);
    let placed = keep.keyframes.into_iter().map(|(stamp_ns, kept)| Kept {
        pose: truth[&stamp_ns],
        ..kept
    });
    placed.collect()
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

#[test]
fn walls_are_where_they_are_and_nowhere_else() {
    let world = World::building();
    let mut keyframes = drive(&world, 7);
    if let Ok(extra) = std::env::var("GRID_SEEDS") {
        for seed in 0..extra.parse().unwrap() {
            let base = keyframes.len() as u64;
            keyframes.extend(drive(&world, 100 + seed).into_iter().map(|k| Kept {
                id: base + k.id,
                ..k
            }));
        }
    }
    let mut config = randt_config::Grid::default();
    let env =
        |name: &str, default: f64| std::env::var(name).map_or(default, |v| v.parse().unwrap());
    config.hits_min = env("HITS", 2.0) as u32;
    config.misses_min = env("MISSES", 1.0) as u32;
    config.occupied_share = env("SHARE", 0.3);
    let mut grid = Grid::new(&config);
    grid.update(keyframes.iter().map(Kept::view));

    let occupied = cells(&grid, CellState::Occupied);
    let free = cells(&grid, CellState::Free);
    let wall_m = |p: &Vector2<f64>| {
        world
            .walls
            .iter()
            .map(|w| distance_m(w, *p))
            .fold(f64::INFINITY, f64::min)
    };
    let true_cells = occupied.iter().filter(|p| wall_m(p) <= NEAR_M).count();
    let mut seen = 0;
    let mut found = 0;
    for wall in &world.walls {
        let count = ((wall.to_m - wall.from_m).norm() / 0.1).ceil().max(1.0) as usize;
        for n in 0..count {
            let at = wall.from_m + (wall.to_m - wall.from_m) * ((n as f64 + 0.5) / count as f64);
            let visible = keyframes.iter().filter(|k| {
                let from = k.pose.translation();
                let d = (from - at).norm();
                d < SEEN_M && d > 0.7 && !is_hidden(&world.walls, from, at)
            });
            if visible.count() >= 3 {
                seen += 1;
                found += usize::from(occupied.iter().any(|p| (p - at).norm() <= NEAR_M));
            }
        }
    }
    let exact = free.iter().filter(|p| wall_m(p) <= 0.03).count();
    let all_wall_cells = free
        .iter()
        .chain(&occupied)
        .filter(|p| wall_m(p) <= 0.03)
        .count();
    println!(
        "{} keyframes, {} occupied {:.1} % near; walls seen {seen} found {:.1} %; free {}; wall cells called free {:.1} %",
        keyframes.len(),
        occupied.len(),
        100.0 * true_cells as f64 / occupied.len() as f64,
        100.0 * f64::from(found as u32) / f64::from(seen),
        free.len(),
        100.0 * exact as f64 / all_wall_cells as f64
    );
    let picture = grid.picture().unwrap();
    if let Ok(path) = std::env::var("GRID_OUT") {
        std::fs::write(path, picture.to_pgm()).unwrap();
    }
    assert!(true_cells as f64 >= 0.9 * occupied.len() as f64);
}
