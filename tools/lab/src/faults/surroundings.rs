//! Surroundings that move along, walk about or jump.

use super::Change;
use super::radar::shift;
use super::returns::{add_body, add_echo, edit, level_db};
use randt_geometry::Pose2;
use randt_geometry::elementary::{PI, cos, sin, sin_cos};
use randt_readers::Event;
use randt_simulator::Random;

/// Where the vehicles of a convoy are, ahead and behind, m; how wide they are, how far they drift
/// to and fro, and how much stronger than a wall. They hide all that is behind them, and no wall
/// hides them: what is to be fooled is the estimate.
const VEHICLE_M: f64 = 3.0;
const VEHICLE_WIDTH_M: f64 = 3.0;
const VEHICLE_DRIFT_M: f64 = 0.05;
const VEHICLE_DB: f64 = 6.0;
/// People, how thick they are, m, and how much weaker than a wall.
const PEOPLE: u32 = 6;
const PERSON_RADIUS_M: f64 = 0.22;
const PERSON_DB: f64 = -6.0;
/// A robot is carried for that long without a word.
const CARRIED_S: f64 = 30.0;

/// Two vehicles drive along.
pub(super) fn convoy(from_s: f64, for_s: f64, mut random: Random) -> Change {
    Box::new(move |event, at_s| {
        let Event::Scan(scan) = event else {
            return true;
        };
        if !(from_s..from_s + for_s).contains(&at_s) {
            return true;
        }
        let drift_m = VEHICLE_DRIFT_M * sin(0.5 * (at_s - from_s));
        edit(scan, |beam, returns| {
            let (sin, cos) = sin_cos(f64::from(beam.azimuth_rad));
            // The face of a box across the way; its sides are out of sight.
            let range_m = (VEHICLE_M + drift_m * cos.signum()) / cos.abs();
            if range_m * sin.abs() <= 0.5 * VEHICLE_WIDTH_M {
                returns.clear();
                let level_db = level_db(range_m) + VEHICLE_DB;
                add_echo(returns, range_m, level_db, &mut random);
            }
        });
        true
    })
}

/// People walk around the robot, each on a way of its own.
pub(super) fn people(mut random: Random) -> Change {
    let phases: Vec<f64> = (0..PEOPLE).map(|_| random.between(-PI, PI)).collect();
    let mut robot = Pose2::IDENTITY;
    Box::new(move |event, at_s| {
        match event {
            Event::Truth(truth) => robot = Pose2::from_array(truth.pose),
            Event::Imu(_) | Event::Twist(_) => {}
            Event::Scan(scan) => {
                let person = |(index, phase): (usize, &f64)| {
                    // Half of them one way round, half the other; a metre a second.
                    let turn = if index % 2 == 0 { 0.35 } else { -0.35 };
                    let bearing_rad = phase + turn * at_s - robot.yaw_rad;
                    let range_m = 2.4 + 1.2 * cos(0.3 * at_s + 2.0 * phase);
                    (bearing_rad, range_m)
                };
                let people: Vec<(f64, f64)> = phases.iter().enumerate().map(person).collect();
                edit(scan, |beam, returns| {
                    for (bearing_rad, range_m) in &people {
                        let (sin, cos) = sin_cos(f64::from(beam.azimuth_rad) - bearing_rad);
                        let across_m = range_m * sin.abs();
                        if cos > 0.0 && across_m < PERSON_RADIUS_M {
                            let depth_m = PERSON_RADIUS_M * PERSON_RADIUS_M - across_m * across_m;
                            let range_m = range_m * cos - depth_m.sqrt();
                            let level_db = level_db(range_m) + PERSON_DB;
                            add_body(returns, range_m, level_db, &mut random);
                        }
                    }
                });
            }
        }
        true
    })
}

/// The robot is carried on without a word: what happens meanwhile is cut out, and the clock goes
/// on as if nothing was.
pub(super) fn kidnapped(from_s: f64) -> Change {
    Box::new(move |event, at_s| {
        let by_ns = -(CARRIED_S * 1e9) as i64;
        if at_s < from_s {
            return true;
        }
        match event {
            Event::Scan(scan) => shift(scan, by_ns),
            Event::Imu(sample) => sample.header.stamp_ns += by_ns,
            Event::Twist(twist) => twist.header.stamp_ns += by_ns,
            Event::Truth(pose) => pose.header.stamp_ns += by_ns,
        }
        at_s >= from_s + CARRIED_S
    })
}
