//! A radar that goes blind for seconds opens a new odometry frame: its component of the map stays
//! separate until loops that agree with one another merge it, and never in the wrong alignment.

use randt_config::Config;
use randt_drives::{Drive, config};
use randt_geometry::elementary::wrap;
use randt_mapper::{KeyframeIdx, Mapper};
use randt_messages::{Keyframe, Message};
use randt_simulator::World;
use std::collections::BTreeSet;

/// Gives the mapper a drive and says how far every loop that it found is off the truth at most (m,
/// degrees).
fn map(world: &World, drive: &Drive) -> (Mapper, f64, f64) {
    let mut mapper = Mapper::new(&config(world));
    for keyframe in &drive.keyframes {
        mapper.push(keyframe.as_ref());
    }
    mapper.finish();
    let truth = |keyframe: usize| drive.truth(mapper.keyframes()[keyframe].stamp_ns);
    let (mut worst_m, mut worst_deg) = (0.0_f64, 0.0_f64);
    for closure in mapper.found() {
        let off = truth(closure.older.0)
            .between(&truth(closure.newer.0))
            .between(&closure.older_from_newer);
        worst_m = worst_m.max(off.translation().norm());
        worst_deg = worst_deg.max(wrap(off.yaw_rad).abs().to_degrees());
    }
    (mapper, worst_m, worst_deg)
}

/// The first keyframe of every component.
fn components(mapper: &Mapper) -> BTreeSet<usize> {
    (0..mapper.keyframes().len())
        .map(|index| mapper.component_of(KeyframeIdx(index)).0)
        .collect()
}

/// How far the newest keyframe is off, seen from the first, over all loops, m.
fn end_off_m(mapper: &Mapper, drive: &Drive) -> f64 {
    let last = mapper.keyframes().len() - 1;
    let truth = |keyframe: usize| drive.truth(mapper.keyframes()[keyframe].stamp_ns);
    let off = truth(0)
        .between(&truth(last))
        .between(&mapper.poses()[0].between(&mapper.poses()[last]));
    off.translation().norm()
}

/// Drives with two blackouts: the robot goes on in the dark for 3 s, or for 40 s, after which it
/// may be anywhere.
fn merge(drives: &[(&str, u64, f64)]) {
    for &(name, seed, dark_s) in drives {
        let world = World::named(name).unwrap();
        let end_s = world.sweeps() as f64 * 0.2;
        let blackout = |share: f64| share * end_s..share * end_s + dark_s;
        let blackouts = [blackout(0.15), blackout(0.35)];
        let drive = Drive::new(&world, world.sweeps(), seed, &blackouts);
        let (mapper, worst_m, worst_deg) = map(&world, &drive);
        let components = components(&mapper);
        let end_off_m = end_off_m(&mapper, &drive);
        println!(
            "{name} seed {seed}, twice {dark_s} s in the dark: {} loops, worst {worst_m:.3} m {worst_deg:.2} deg; components begin at {components:?}; end off by {end_off_m:.3} m",
            mapper.found().count(),
        );
        assert!(worst_m < 0.5 && worst_deg < 5.0, "a false loop");
        // After 40 s a component may be too short to say where it is: then it stays separate.
        let components_max = if dark_s < 10.0 { 1 } else { 2 };
        assert!(components.len() <= components_max);
        assert!(end_off_m < 0.5);
    }
}

#[test]
fn components_are_merged_where_the_robot_comes_back_and_nowhere_else() {
    merge(&[("yard", 1, 3.0), ("building", 2, 40.0)]);
}

#[test]
#[ignore = "a minute and a half: the long form"]
fn components_of_every_world_are_merged() {
    for name in World::NAMES {
        merge(&[(name, 1, 3.0), (name, 2, 40.0)]);
    }
}

#[test]
fn a_component_without_a_revisit_stays_separate() {
    for (seed, dark_s) in [(1, 3.0), (2, 3.0), (3, 40.0)] {
        let world = World::building();
        let drive = Drive::new(&world, 900, seed, &[60.0..60.0 + dark_s]);
        let (mapper, worst_m, worst_deg) = map(&world, &drive);
        println!(
            "worst {worst_m:.3} m {worst_deg:.2} deg; components {:?}",
            components(&mapper)
        );
        assert!(worst_m < 0.5 && worst_deg < 5.0, "a false loop");
        assert_eq!(components(&mapper).len(), 2);
    }
}

#[test]
fn keyframes_that_cannot_be_are_left_out_and_counted() {
    let mut mapper = Mapper::new(&Config::default());
    let mut keyframe = Message::<Keyframe>::default();
    let mut push = |id, odom_frame_id, stamp_ns, x_m| {
        let head = &mut keyframe.head;
        (head.id, head.odom_frame_id, head.header.stamp_ns) = (id, odom_frame_id, stamp_ns);
        head.pose = [x_m, 0.0, 0.0];
        mapper.push(keyframe.as_ref());
        (
            mapper.keyframes().len(),
            mapper.counters().keyframes_rejected,
        )
    };
    assert_eq!(push(0, 0, 5_000, 0.0), (1, 0));
    assert_eq!(push(1, 0, 6_000, 0.5), (2, 0));
    assert_eq!(push(1, 0, 7_000, 1.0), (2, 1), "a number again");
    assert_eq!(push(2, 0, 6_000, 1.0), (2, 2), "a stamp again");
    assert_eq!(push(3, 0, 7_000, f64::NAN), (2, 3));
    assert_eq!(push(4, 0, 7_000, 1e300), (2, 4));
    // The clock was set back: another frame, and a separate component.
    assert_eq!(push(5, 1, 1_000, 0.0), (3, 4));
    assert_eq!(push(6, 0, 8_000, 1.0), (3, 5), "an old frame again");
    mapper.finish();
    assert_eq!(components(&mapper).into_iter().collect::<Vec<_>>(), [0, 2]);
}
