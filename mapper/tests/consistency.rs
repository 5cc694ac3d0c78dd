//! Whether the map is as sure as it is right: errors of nodes, weighed by their covariance.

use crate::growth::hall;
use nalgebra::Vector3;
use randt_drives::{Drive, config};
use randt_geometry::elementary::wrap;
use randt_mapper::{KeyframeIdx, Mapper};
use randt_simulator::World;

/// Squares of the errors of all nodes seen from the first one, weighed by their covariance. Of
/// three numbers: 3 where the covariance is right.
fn weighed_squares(world: &World, scans: u64, seed: u64, laps_max: u32) -> Vec<f64> {
    let drive = Drive::new(world, scans, seed, &[]);
    let mut config = config(world);
    config.loops.laps_max = laps_max;
    let mut mapper = Mapper::new(&config);
    for keyframe in &drive.keyframes {
        mapper.push(keyframe.as_ref());
    }
    mapper.finish();
    let stamps: Vec<i64> = mapper.keyframes().iter().map(|it| it.stamp_ns).collect();
    let first = KeyframeIdx(0);
    let square = |index: usize| {
        let (pose, covariance) = mapper.relative(first, KeyframeIdx(index))?;
        let truth = drive.truth(stamps[0]).between(&drive.truth(stamps[index]));
        let off = pose.between(&truth);
        let off = Vector3::new(off.x_m, off.y_m, wrap(off.yaw_rad));
        Some(off.dot(&(covariance.try_inverse()? * off)))
    };
    (1..stamps.len()).filter_map(square).collect()
}

/// Means of 20 drives, pooled.
fn pooled(world: &World, scans: u64, laps_max: u32) -> f64 {
    let mut all = Vec::new();
    for seed in 1..=20 {
        let squares = weighed_squares(world, scans, seed, laps_max);
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        println!("seed {seed}: {} nodes, {mean:.2}", squares.len());
        all.extend(squares);
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    println!("{} nodes: {mean:.2}", all.len());
    mean
}

#[test]
#[ignore = "five minutes: 20 drives"]
fn nodes_are_as_far_off_as_the_map_says() {
    let world = World::building();
    let mean = pooled(&world, world.sweeps(), 3);
    assert!((1.5..6.0).contains(&mean), "{mean}");
}

/// Three laps and a half of one room, of which the first one stays: its map is better than it
/// says, because what one room holds does not drift.
#[test]
#[ignore = "minutes: 20 drives"]
fn nodes_of_one_room_are_no_farther_off_than_the_map_says() {
    let mean = pooled(&hall(), 1050, 1);
    assert!(mean < 6.0, "{mean}");
}
