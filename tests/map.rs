//! The map that a run leaves behind: exact, not mirrored, readable by Nav2, and there whatever the
//! drive was.

use crate::support::{
    OUTPUTS, Row, drive, figures, l_shaped_world, names, pose_at, recording, report, run, tum,
};
use randt_geometry::Pose2;
use randt_simulator::World;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Grey values of a trinary map.
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;
const FREE: u8 = 254;

/// `map.pgm` and `map.yaml`, read as Nav2's map_server does.
struct Map {
    keys: BTreeMap<String, String>,
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Map {
    fn read(folder: &Path) -> Self {
        let yaml = fs::read_to_string(folder.join("map.yaml")).unwrap();
        let keys: BTreeMap<String, String> = yaml
            .lines()
            .map(|line| line.split_once(": ").unwrap())
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .collect();
        let bytes = fs::read(folder.join(&keys["image"])).unwrap();
        let mut fields = bytes.splitn(4, |byte| byte.is_ascii_whitespace());
        let mut word = || str::from_utf8(fields.next().unwrap()).unwrap();
        assert_eq!(word(), "P5");
        let [width, height] = [(); 2].map(|()| word().parse().unwrap());
        let rest = fields.next().unwrap();
        let pixels = rest.strip_prefix(b"255\n").unwrap().to_vec();
        assert_eq!(pixels.len(), width * height);
        Self {
            keys,
            width,
            height,
            pixels,
        }
    }

    fn number(&self, key: &str) -> f64 {
        self.keys[key].parse().unwrap()
    }

    /// x, y, yaw of the picture's lower left corner.
    fn origin(&self) -> [f64; 3] {
        let list = &self.keys["origin"];
        let list = list.strip_prefix('[').unwrap().strip_suffix(']').unwrap();
        let values: Vec<f64> = list.split(", ").map(|v| v.parse().unwrap()).collect();
        values.try_into().unwrap()
    }

    /// The middles of the cells of a value; the picture's first row is the one of largest y.
    fn cells_m(&self, value: u8) -> Vec<[f64; 2]> {
        let (edge_m, [x_m, y_m, yaw]) = (self.number("resolution"), self.origin());
        assert_eq!(yaw, 0.0);
        let cells = self.pixels.iter().enumerate().filter(|(_, v)| **v == value);
        cells
            .map(|(index, _)| {
                let (column, row) = (index % self.width, self.height - 1 - index / self.width);
                [
                    x_m + (column as f64 + 0.5) * edge_m,
                    y_m + (row as f64 + 0.5) * edge_m,
                ]
            })
            .collect()
    }
}

/// The rigid motion of least squares that lays positions onto others.
fn alignment(from: &[[f64; 2]], to: &[[f64; 2]]) -> Pose2 {
    assert_eq!(from.len(), to.len());
    let mean = |points: &[[f64; 2]]| {
        [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / points.len() as f64)
    };
    let (a, b) = (mean(from), mean(to));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (f, t) in from.iter().zip(to) {
        let (f, t) = ([f[0] - a[0], f[1] - a[1]], [t[0] - b[0], t[1] - b[1]]);
        dot += f[0] * t[0] + f[1] * t[1];
        cross += f[0] * t[1] - f[1] * t[0];
    }
    let yaw_rad = randt_geometry::elementary::atan2(cross, dot);
    let turned = Pose2::new(0.0, 0.0, yaw_rad).transform(a.into());
    Pose2::new(b[0] - turned.x, b[1] - turned.y, yaw_rad)
}

fn mirrored(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.iter().map(|p| [p[0], -p[1]]).collect()
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    (dx * dx + dy * dy).sqrt()
}

/// Points on all walls of a world, 5 cm apart at most.
fn wall_points_m(world: &World) -> Vec<[f64; 2]> {
    const STEP_M: f64 = 0.05;
    let mut points = Vec::new();
    for wall in &world.walls {
        let along = wall.to_m - wall.from_m;
        let steps = (along.norm() / STEP_M).ceil().max(1.0);
        for step in 0..=steps as usize {
            let point = wall.from_m + along * (step as f64 / steps);
            points.push([point.x, point.y]);
        }
    }
    points
}

/// Share of points that have another one within a distance.
fn share_near(points: &[[f64; 2]], others: &[[f64; 2]], within_m: f64) -> f64 {
    assert!(!points.is_empty());
    let near = |point: &&[f64; 2]| others.iter().any(|o| distance_m(**point, *o) <= within_m);
    points.iter().filter(near).count() as f64 / points.len() as f64
}

fn positions(rows: &[Row]) -> Vec<[f64; 2]> {
    rows.iter()
        .map(|row| [row.pose.x_m, row.pose.y_m])
        .collect()
}

#[test]
fn the_map_shows_the_hall_as_it_is_and_not_its_mirror_image() {
    /// A cell is right when a wall is so near: two cells.
    const NEAR_M: f64 = 0.2;
    /// Walls so near the route are seen from it.
    const ROUTE_M: f64 = 3.0;
    let folder = tempfile::tempdir().unwrap();
    let (log, truth) = l_shaped_world::drive(folder.path());
    let out = folder.path().join("out");
    let ended = run(&log, &out, &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let (estimate, truth) = (tum(&out.join("trajectory.tum")), tum(&truth));
    let driven = positions(&estimate);
    let true_route: Vec<[f64; 2]> = estimate
        .iter()
        .map(|row| pose_at(&truth, row.stamp_ns))
        .map(|pose| [pose.x_m, pose.y_m])
        .collect();
    let to_world = |points: &[[f64; 2]], motion: &Pose2| -> Vec<[f64; 2]> {
        let moved = points.iter().map(|p| motion.transform((*p).into()));
        moved.map(|p| [p.x, p.y]).collect()
    };
    let aligned = alignment(&driven, &true_route);
    let map = Map::read(&out);
    let occupied = map.cells_m(OCCUPIED);
    let walls = wall_points_m(&World::parse("hall", l_shaped_world::WORLD).unwrap());

    let cells = to_world(&occupied, &aligned);
    let right = share_near(&cells, &walls, NEAR_M);
    // Three ways to be mirrored: the picture upside down, the map's y, the whole run with its
    // trajectory.
    let [_, y_m, _] = map.origin();
    let top_m = y_m + map.height as f64 * map.number("resolution");
    let upside_down: Vec<[f64; 2]> = occupied
        .iter()
        .map(|p| [p[0], y_m + top_m - p[1]])
        .collect();
    let all_mirrored = alignment(&mirrored(&driven), &true_route);
    let wrong = [
        to_world(&upside_down, &aligned),
        to_world(&mirrored(&occupied), &aligned),
        to_world(&mirrored(&occupied), &all_mirrored),
    ]
    .map(|cells| share_near(&cells, &walls, NEAR_M));
    let near_route: Vec<[f64; 2]> = walls
        .iter()
        .copied()
        .filter(|wall| true_route.iter().any(|p| distance_m(*p, *wall) <= ROUTE_M))
        .collect();
    let found = share_near(&near_route, &cells, NEAR_M);
    let free = share_near(&driven, &map.cells_m(FREE), map.number("resolution"));
    println!(
        "{} occupied cells, {:.1} % at a wall; mirrored {:.1?} %; {:.1} % of the walls found; {:.1} % of the route free",
        cells.len(),
        100.0 * right,
        wrong.map(|share| 100.0 * share),
        100.0 * found,
        100.0 * free
    );
    assert!(right >= 0.9, "{right}");
    assert!(wrong.iter().all(|share| *share < 0.9), "{wrong:?}");
    assert!(found >= 0.6, "{found}");
    assert!(free >= 0.95, "{free}");
}

#[test]
fn nav2_finds_every_key_that_it_wants() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&drive::events(60), &log);
    let out = folder.path().join("out");
    assert_eq!(run(&log, &out, &[]).code, Some(0));
    let map = Map::read(&out);
    let keys: Vec<&str> = map.keys.keys().map(String::as_str).collect();
    assert_eq!(
        keys,
        [
            "free_thresh",
            "image",
            "mode",
            "negate",
            "occupied_thresh",
            "origin",
            "resolution"
        ]
    );
    assert_eq!(map.keys["image"], "map.pgm");
    assert_eq!(map.keys["mode"], "trinary");
    assert_eq!(map.keys["negate"], "0");
    assert_eq!(map.number("resolution"), 0.1);
    for value in [OCCUPIED, UNKNOWN, FREE] {
        assert!(map.pixels.contains(&value), "no pixel of {value}");
    }
    assert!(
        map.pixels
            .iter()
            .all(|value| [OCCUPIED, UNKNOWN, FREE].contains(value))
    );
    // What map_server makes of the values by the thresholds.
    let darkness = |value: u8| f64::from(255 - value) / 255.0;
    assert!(darkness(OCCUPIED) > map.number("occupied_thresh"));
    assert!(darkness(FREE) < map.number("free_thresh"));
    let between = map.number("free_thresh")..=map.number("occupied_thresh");
    assert!(between.contains(&darkness(UNKNOWN)));
}

#[test]
fn loops_do_no_harm_in_a_room_that_odometry_holds_alone() {
    let (Some(bag), Some(truth)) = (
        recording("bags/room_loops.bag"),
        recording("bags/room_loops_gt.tum"),
    ) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let ended = run(&bag, &out, &[&["--profile", "mixed"], more].concat());
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        out
    };
    let (with, without) = (run("with", &[]), run("without", &["--no-loops"]));
    let ate_m = |figures: &serde_json::Value| figures["ate_rmse_m"].as_f64().unwrap();
    let last = figures(&with, "trajectory.tum", &truth);
    let live_m = ate_m(&figures(&with, "odometry.tum", &truth));
    let without_m = ate_m(&figures(&without, "trajectory.tum", &truth));
    let loops = &last["loops"];
    println!(
        "ATE {:.5} m, live {live_m:.5} m, without loops {without_m:.5} m; loops {loops}",
        ate_m(&last)
    );
    assert!(ate_m(&last) <= 0.018);
    assert!(ate_m(&last) <= live_m);
    // In one room every scan meets the first one's submap: loops have nothing to win there, and
    // may cost no more than half a millimetre.
    assert!(ate_m(&last) <= without_m + 5e-4);
    assert_eq!(loops["false_loops"], serde_json::json!([]));
    assert!(
        loops["loops"].as_u64() > loops["unjudged"].as_u64(),
        "a true one"
    );
}

#[test]
fn a_log_of_one_scan_or_without_motion_has_a_map_too() {
    // The drive begins with 2.5 s of standstill, five scans a second.
    for scans in [1, 10] {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("drive.mcap");
        drive::write(&drive::events(scans), &log);
        let out = folder.path().join("out");
        let ended = run(&log, &out, &[]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert_eq!(names(&out), OUTPUTS);
        let trajectory = positions(&tum(&out.join("trajectory.tum")));
        assert_eq!(trajectory.len() as u64, scans);
        let moved_m = trajectory.iter().map(|p| distance_m(*p, trajectory[0]));
        let moved_m = moved_m.fold(0.0, f64::max);
        let (map, report) = (Map::read(&out), report(&out));
        println!(
            "{scans} scans: moved {moved_m:.4} m, {} keyframes, map of {} x {}, {} cells occupied",
            report["keyframes"],
            map.width,
            map.height,
            map.cells_m(OCCUPIED).len()
        );
        assert_eq!(report["scans"], scans);
        assert_eq!(report["loops"]["candidates"], serde_json::json!([]));
        assert!(moved_m < 0.05, "a robot that stands");
    }
}
