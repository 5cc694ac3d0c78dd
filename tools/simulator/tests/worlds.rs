//! The worlds that come with the program, and what a world's text may hold.

use nalgebra::Vector2;
use proptest::prelude::*;
use randt_geometry::{Pose2, elementary};
use randt_simulator::{Drive, Event, Material, Robot, Simulation, Wall, World, WorldError};

const TEXTS: [&str; 3] = [
    include_str!("../worlds/building.world"),
    include_str!("../worlds/yard.world"),
    include_str!("../worlds/tunnel.world"),
];
const GUIDE: &str = include_str!("../../../docs/worlds.md");

fn worlds() -> impl Iterator<Item = World> {
    World::NAMES.iter().map(|name| World::named(name).unwrap())
}

fn distance_m(wall: &Wall, point: Vector2<f64>) -> f64 {
    let along = wall.to_m - wall.from_m;
    let share = ((point - wall.from_m).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (wall.from_m + along * share - point).norm()
}

/// Poses every tenth of a second of the drive that `randt simulate` makes.
fn poses(world: &World, seed: u64) -> Vec<Pose2> {
    let mut drive = Drive::new(world, Robot::for_world(world).motion, seed);
    let tenths = world.sweeps() as i64 * 2;
    (0..tenths)
        .map(|tenth| drive.at(tenth * 100_000_000).pose2())
        .collect()
}

#[test]
fn two_laps_and_a_little_clear_of_everything() {
    for world in worlds() {
        for seed in 1..=4 {
            let mut drive = Drive::new(&world, Robot::for_world(&world).motion, seed);
            let (mut laps, mut lap_m) = (0, [0.0; 9]);
            for step in 0..world.sweeps() as i64 {
                let state = drive.at(step * 200_000_000);
                if drive.laps() > laps {
                    laps = drive.laps();
                    lap_m[laps as usize] = state.path_m;
                }
                let at = Vector2::new(state.pose[0], state.pose[1]);
                let clear_m = world
                    .walls
                    .iter()
                    .map(|wall| distance_m(wall, at))
                    .fold(9.0, f64::min);
                assert!(
                    clear_m > 0.25,
                    "{}: {clear_m} m from a wall at {at}",
                    world.name
                );
            }
            let rest_m = drive.at(world.sweeps() as i64 * 200_000_000).path_m - lap_m[2];
            let lap_m = lap_m[2] - lap_m[1];
            println!(
                "{} {seed}: {} sweeps, lap {lap_m:.1} m, {rest_m:.1} m more",
                world.name,
                world.sweeps()
            );
            assert_eq!(laps, 2, "{}", world.name);
            assert!((100.0..200.0).contains(&lap_m) && rest_m < 0.3 * lap_m);
        }
    }
}

#[test]
fn corridors_are_driven_both_ways_in_the_building() {
    let poses = poses(&World::building(), 1);
    // Against an earlier heading at the same point, at least 30 s later.
    let against = poses.iter().enumerate().skip(300).filter(|(index, now)| {
        poses.iter().take(index - 300).any(|then| {
            (then.translation() - now.translation()).norm() < 0.5
                && elementary::wrap(then.yaw_rad - now.yaw_rad).abs() > 2.8
        })
    });
    assert!(against.count() > 200);
}

#[test]
fn the_building_turned_by_half_a_turn_resembles_itself_but_differs() {
    let world = World::building();
    let turned = |point: Vector2<f64>| Vector2::new(40.0, 24.0) - point;
    let length_m = |wall: &Wall| (wall.to_m - wall.from_m).norm();
    let again = |wall: &Wall| {
        let middle = turned((wall.from_m + wall.to_m) * 0.5);
        world.walls.iter().any(|other| {
            other.material == wall.material
                && (length_m(other) - length_m(wall)).abs() < 0.1
                && ((other.from_m + other.to_m) * 0.5 - middle).norm() < 0.1
        })
    };
    let all_m: f64 = world.walls.iter().map(length_m).sum();
    let same_m: f64 = world
        .walls
        .iter()
        .filter(|wall| again(wall))
        .map(length_m)
        .sum();
    let share = same_m / all_m;
    assert!((0.6..0.9).contains(&share), "{share}");
}

#[test]
fn the_yard_slopes_as_a_robot_climbs_and_the_others_are_level() {
    for world in worlds() {
        let steepest = poses(&world, 1).iter().fold(0.0_f64, |steepest, pose| {
            steepest.max(world.ground.at(pose.translation()).gradient.norm())
        });
        let degrees = elementary::atan2(steepest, 1.0).to_degrees();
        match world.name.as_str() {
            "yard" => assert!((5.0..8.5).contains(&degrees), "{degrees} degrees"),
            _ => assert_eq!(degrees, 0.0),
        }
    }
}

/// The first sweep before a wall that stands 5 m uphill.
fn uphill(grade: f64) -> f64 {
    let text = format!("slope {grade},0\nwall metal 7,-9 7,9\nroute 0,0 8,0 8,8 0,8");
    let world = World::parse("hill", &text).unwrap();
    let robot = Robot {
        radar_mounting: Pose2::IDENTITY,
        ..Robot::default()
    };
    let start = Drive::new(&world, robot.motion, 1).at(0).pose2();
    assert_eq!((start.y_m, start.yaw_rad), (0.0, 0.0));
    let scan = Simulation::new(&world, robot, 1, 1).find_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    let scan = scan.unwrap();
    let ahead = scan.items.iter().filter(|item| {
        let azimuth_rad = scan.head.sweep.beams()[usize::from(item.beam)].azimuth_rad;
        azimuth_rad.abs() < 0.02 && item.range_m > 1.0
    });
    let strongest = ahead
        .max_by(|a, b| a.intensity.total_cmp(&b.intensity))
        .unwrap();
    f64::from(strongest.range_m) / (7.0 - start.x_m)
}

#[test]
fn a_wall_uphill_is_seen_along_the_slope() {
    let (level, steep) = (uphill(0.0), uphill(0.3));
    assert!((level - 1.0).abs() < 0.005, "{level}");
    assert!((steep - 1.09_f64.sqrt()).abs() < 0.005, "{steep}");
}

#[test]
fn a_beam_into_the_foot_of_a_bank_returns_clutter() {
    // Ground alone: level, then a bank that rises by 0.9 m from about 2 m ahead.
    let returns = |ramp: &str| {
        let world = World::parse("bank", &format!("{ramp}\nroute 0,0 8,0 8,8 0,8")).unwrap();
        let scans =
            Simulation::new(&world, Robot::for_world(&world), 5, 1).filter_map(
                |event| match event {
                    Event::Scan(scan) => Some(scan),
                    _ => None,
                },
            );
        let seen = |scan: &randt_messages::Message<randt_messages::RadarScan>| {
            let beams = scan.head.sweep.beams();
            let ahead = scan.items.iter().filter(|item| {
                beams[usize::from(item.beam)].azimuth_rad.abs() < 0.3
                    && (3.0..7.0).contains(&item.range_m)
                    && item.intensity > 10.0
            });
            ahead.count()
        };
        scans.map(|scan| seen(&scan)).sum::<usize>()
    };
    let (bank, level) = (returns("ramp 3,0 9,0 0.9"), returns(""));
    assert!(bank > 3 * level + 20, "{bank} {level}");
}

#[test]
fn a_seed_gives_the_same_sweeps_on_a_slope_as_well() {
    let bytes = || {
        let world = World::named("yard").unwrap();
        let mut bytes = Vec::new();
        for event in Simulation::new(&world, Robot::for_world(&world), 20, 3) {
            if let Event::Scan(scan) = event {
                scan.as_ref().write_bytes(&mut bytes);
            }
        }
        bytes
    };
    assert!(bytes() == bytes());
}

#[test]
fn the_guides_example_can_be_driven() {
    let example = GUIDE
        .split("```")
        .nth(1)
        .unwrap()
        .trim_start_matches("text");
    let world = World::parse("example", example).unwrap();
    let mut drive = Drive::new(&world, Robot::for_world(&world).motion, 1);
    for step in 0..world.sweeps() as i64 {
        let at = drive.at(step * 200_000_000).pose2().translation();
        let clear_m = world
            .walls
            .iter()
            .map(|wall| distance_m(wall, at))
            .fold(9.0, f64::min);
        assert!(clear_m > 0.3, "{clear_m} m from a wall at {at}");
    }
    assert_eq!(drive.laps(), 2);
    // It shows every statement there is.
    for statement in [
        "wall", "rough", "block", "post", "route", "speed", "slope", "hill", "ramp",
    ] {
        assert!(
            example.lines().any(|line| line.starts_with(statement)),
            "{statement}"
        );
        assert!(GUIDE.contains(&format!("| `{statement} ")), "{statement}");
    }
}

#[test]
fn the_guide_lists_every_world() {
    for world in worlds() {
        let row = format!("| `{}` |", world.name);
        let row = GUIDE.lines().find(|line| line.starts_with(&row)).unwrap();
        let sweeps = format!("| {} |", world.sweeps());
        assert!(row.contains(&sweeps), "{row} lacks {sweeps}");
    }
    for material in Material::ALL.map(Material::name) {
        assert!(GUIDE.contains(&format!("`{material}`")), "{material}");
    }
}

#[test]
fn errors_name_the_line_the_word_and_what_would_be_right() {
    let route = "route 0,0 1,0 1,1\n";
    for (text, expected) in [
        (
            "\n# hm\nwal concrete 0,0 1,0",
            "line 3: \"wal\": expected one of wall, rough,",
        ),
        (
            "wall marble 0,0 1,0",
            "line 1: \"marble\": expected one of concrete,",
        ),
        (
            "wall wood 0,0",
            "line 1: \"wall\" ends too early: expected a second point",
        ),
        (
            "wall wood 0,0 0,0",
            "line 1: \"0,0\": expected a point apart",
        ),
        (
            "wall wood 0,0 1;0",
            "line 1: \"1;0\": expected X,Y, each -500 to 500",
        ),
        ("wall wood 0,0 nan,0", "line 1: \"nan,0\": expected X,Y"),
        (
            "wall wood 0,0 9,0 1..2",
            "line 1: \"1..2\": expected a point X,Y, or doors",
        ),
        (
            "wall wood 0,0 9,0 doors 3..2",
            "line 1: \"3..2\": expected an opening FROM..TO within 0..9.00 m",
        ),
        (
            "wall wood 0,0 9,0 doors 1..3 gaps 2..4",
            "\"2..4\": expected an opening apart",
        ),
        (
            "rough wood 0.1 sed 3 0,0 9,0",
            "line 1: \"sed\": expected seed",
        ),
        (
            "rough wood 0.1 seed -3 0,0 9,0",
            "\"-3\": expected a seed: a whole number",
        ),
        (
            "rough wood 7 seed 3 0,0 9,0",
            "\"7\": expected an amplitude in m, 0.01 to 1",
        ),
        (
            "block wood 1,1 2",
            "line 1: \"2\": expected a size WIDTHxDEPTH in m",
        ),
        (
            "block wood 1,1 2x2 twist 3",
            "\"twist\": expected turn, or the line's end",
        ),
        (
            "post wood 1,1 0.1 0.2",
            "line 1: \"0.2\": expected the line's end",
        ),
        (
            "hill 0,0 5 4",
            "line 1: \"hill\": expected a grade of at most 0.3",
        ),
        (
            "ramp 0,0 0,0 1",
            "\"0,0\": expected a head at least 1 m from the foot",
        ),
        ("speed fast", "\"fast\": expected a speed in m/s, 0.2 to 3"),
    ] {
        let error = World::parse("w", &format!("{text}\n{route}"))
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{text:?}: {error}");
    }
    let error = World::parse("w", "route 0,0 1,1").unwrap_err();
    assert_eq!(error, WorldError::Route { corners: 2 });
    let long = "rough wood 0.1 seed 1".to_owned() + &" -500,0 500,0".repeat(30);
    assert!(matches!(
        World::parse("w", &long),
        Err(WorldError::Large { line: 1, .. })
    ));
}

proptest! {
    #[test]
    fn corrupted_worlds_are_errors_or_worlds(
        text in 0..TEXTS.len(),
        edits in prop::collection::vec((0.0..1.0_f64, 0..3_u8, prop::sample::select(
            "0123456789.,-x# \nwallroughturn\u{e9}\u{0}".chars().collect::<Vec<_>>()
        )), 1..20),
    ) {
        let mut letters: Vec<char> = TEXTS[text].chars().collect();
        for (share, kind, letter) in edits {
            let index = (share * letters.len() as f64) as usize;
            match kind {
                0 => letters[index] = letter,
                1 => letters.insert(index, letter),
                _ => { letters.remove(index); }
            }
        }
        let text: String = letters.into_iter().collect();
        if let Ok(world) = World::parse("corrupted", &text) {
            let mut drive = Drive::new(&world, Robot::for_world(&world).motion, 1);
            prop_assert!(drive.at(5_000_000_000).pose.iter().all(|value| value.is_finite()));
        }
    }
}
