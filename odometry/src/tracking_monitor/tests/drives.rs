//! Trust in a bare corridor, before a radar that froze, and after a robot was carried elsewhere.

use super::*;
use crate::{Odometry, Sink, localizability::wall_information};
use randt_filter::ClusterFilter;
use randt_geometry::elementary::sin;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_simulator::{Event, Robot, Simulation, World};
use std::collections::BTreeMap;

/// The mean fit along a bare wall.
const USUAL_FIT: f64 = 0.75;

/// Sixty metres without anything; the robot drives to and fro in the middle and never sees an end.
const CORRIDOR: &str = "
wall concrete 0,-1.3 60,-1.3
wall concrete 0,1.3 60,1.3
route 25,-0.3 35,-0.3 35.3,0 35,0.3 25,0.3 24.7,0
";

/// What odometry published.
#[derive(Default)]
struct States(Vec<OdometryState>);

impl Sink for States {
    fn state(&mut self, state: &OdometryState) {
        self.0.push(*state);
    }
    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

impl States {
    fn from_drive(events: &[Event], config: &Config) -> Vec<OdometryState> {
        let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
        let mut points = Message::<RadarPoints>::default();
        let mut odometry = Odometry::new(config, true);
        let mut states = Self::default();
        for event in events {
            match event {
                Event::Scan(scan) => {
                    filter.process(scan.as_ref(), &mut points);
                    odometry.push_points(points.as_ref(), &mut states);
                }
                Event::Imu(sample) => odometry.push_imu(sample, &mut states),
                Event::Twist(_) | Event::Truth(_) => {}
            }
        }
        odometry.finish(&mut states);
        states.0
    }
}

fn events(world: &World, scans: u64) -> Vec<Event> {
    Simulation::new(world, Robot::for_world(world), scans, 4).collect()
}

fn config_of(world: &World) -> Config {
    let mounting = Robot::for_world(world).radar_mounting;
    let mut config = Config::default();
    (config.robot.radar_x_m, config.robot.radar_y_m) = (mounting.x_m, mounting.y_m);
    config
}

/// Number of states with a trust.
fn count(states: &[OdometryState], trust: Trust) -> usize {
    let alike = states.iter().filter(|state| state.trust() == trust);
    alike.count()
}

#[test]
fn in_a_bare_corridor_the_grid_makes_the_information_and_trust_is_not_good() {
    let world = World::parse("corridor", CORRIDOR).unwrap();
    let events = events(&world, 60);
    for slack in [0.0, 5.0, 50.0] {
        let mut config = config_of(&world);
        config.ndt.slack = slack;
        let states = States::from_drive(&events, &config);
        // The first scan is the map; the second one is set against a single scan.
        let states = states.get(5..).unwrap();
        let mut along: Vec<f64> = states
            .iter()
            .map(|s| s.information_eigenvalues[0])
            .collect();
        along.sort_by(f64::total_cmp);
        let (median, formula) = (along[along.len() / 2], wall_information(USUAL_FIT, &config));
        println!("slack {slack}: {median:.0} / m^2, {formula:.0} in closed form");
        assert!(
            (0.5..3.0).contains(&(median / formula)),
            "slack {slack}: {median} / m^2, {formula} in closed form"
        );
        assert_eq!(count(states, Trust::Good), 0, "slack {slack}");
        let weak = states.iter().filter_map(|state| {
            let in_corridor = state.weak_direction()? + state.pose[2];
            Some(sin(in_corridor).abs() < sin(10_f64.to_radians()))
        });
        let weak: Vec<bool> = weak.collect();
        let along = weak.iter().filter(|along| **along).count();
        println!("weak in {}, along the corridor in {along}", weak.len());
        assert!(along * 10 >= states.len() * 9, "slack {slack}");
    }
}

#[test]
fn between_two_ends_out_of_sight_the_imu_carries_the_pose() {
    // Forty metres: the middle eight show no end.
    let corridor = "wall concrete 0,-1.3 42,-1.3 42,1.3 0,1.3 0,-1.3\nroute 1,-0.3 5,-0.3 40,-0.3 40.3,0 40,0.3 1,0.3 0.7,0";
    let world = World::parse("corridor", corridor).unwrap();
    let events = events(&world, 220);
    let states = States::from_drive(&events, &config_of(&world));
    let truths: BTreeMap<i64, [f64; 3]> = (events.iter())
        .filter_map(|event| match event {
            Event::Truth(truth) => Some((truth.header.stamp_ns, truth.pose)),
            _ => None,
        })
        .collect();
    let weak = |state: &OdometryState| state.weak_direction().is_some();
    // One scan that sees no end may be followed by some that do: the longest stretch counts.
    let blind_after = |scan: &usize| states[scan + 1..].iter().take_while(|s| weak(s)).count();
    let first = (19..states.len() - 1)
        .rev()
        .max_by_key(blind_after)
        .unwrap();
    let blind = blind_after(&first);
    assert!(blind >= 20, "{blind} scans");
    let at = |scan: usize| (states[scan], truths[&states[scan].header.stamp_ns]);
    let ((from, from_true), (to, to_true)) = (at(first), at(first + blind));
    let moved = to.pose[0] - from.pose[0];
    let off_m = (moved - (to_true[0] - from_true[0])).abs();
    let blind_states = states[first..=first + blind].iter();
    let sigma_m = blind_states
        .map(|s| s.covariance[0].sqrt())
        .fold(0.0, f64::max);
    println!("{off_m:.2} m off after {moved:.2} m, {blind} scans; said {sigma_m:.2} m");
    assert!(off_m < 0.3 * moved && off_m < 3.0 * sigma_m && sigma_m < 1.5);
    assert_eq!(to.trust(), Trust::Degraded);
}

#[test]
fn a_frozen_radar_is_doubted_at_once_and_its_frame_goes_on() {
    let world = World::building();
    let mut events = events(&world, 150);
    let mut scans = events.iter_mut().filter_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    let frozen = scans.nth(79).unwrap().items.clone();
    let beams = |scan: &Message<randt_messages::RadarScan>| {
        let firsts = scan.head.sweep.beams.iter().map(|beam| beam.first_return);
        firsts.collect::<Vec<u32>>()
    };
    let mut firsts = None;
    for scan in scans.take(15) {
        let firsts = firsts.get_or_insert_with(|| beams(scan)).clone();
        scan.items.clone_from(&frozen);
        for (beam, first) in scan.head.sweep.beams.iter_mut().zip(firsts) {
            beam.first_return = first.min(frozen.len() as u32);
        }
    }
    let states = States::from_drive(&events, &config_of(&world));
    let repeated = |s: &&OdometryState| s.trust_reasons & TrustReason::Repeated as u32 != 0;
    assert_eq!(states.iter().filter(repeated).count(), 15 - 1);
    assert_eq!(count(&states[82..95], Trust::Good), 0);
    assert!(states.iter().all(|state| state.odom_frame_id == 0));
    assert_eq!(states.last().unwrap().trust(), Trust::Good);
}

#[test]
fn the_frame_of_a_robot_that_was_carried_elsewhere_ends_within_a_second() {
    let world = World::building();
    let mut events = events(&world, 250);
    // Thirty seconds are cut out, and what follows is moved to their begin.
    let scan = |events: &[Event], number: usize| {
        let scans = events.iter().enumerate();
        let mut scans = scans.filter(|(_, event)| matches!(event, Event::Scan(_)));
        scans.nth(number).unwrap().0
    };
    let (from, to) = (scan(&events, 80) + 1, scan(&events, 230) + 1);
    events.drain(from..to);
    for event in events.iter_mut().skip(from) {
        shift(event, -150 * SWEEP_NS);
    }
    let states = States::from_drive(&events, &config_of(&world));
    let (before, after) = states.split_at(81);
    assert_eq!(count(&before[20..], Trust::Good), 61);
    let good = after.iter().take_while(|s| s.trust() == Trust::Good);
    let good = good.count();
    println!(
        "doubted after {good} scans; trust of all that follow: {:?}",
        after.iter().map(|s| s.trust).collect::<Vec<_>>()
    );
    assert!(good < 5, "{good} scans");
    let frames: Vec<u64> = after.iter().map(|state| state.odom_frame_id).collect();
    assert!(
        frames[..3].iter().all(|frame| *frame == 0) && frames[5..].iter().all(|frame| *frame == 1),
        "{frames:?}"
    );
    assert_eq!(after.last().unwrap().trust(), Trust::Good);
}

/// Moves an event in time, its beams included.
fn shift(event: &mut Event, by_ns: i64) {
    match event {
        Event::Scan(scan) => {
            scan.head.header.stamp_ns += by_ns;
            let sweep = &mut scan.head.sweep;
            sweep.begin_ns += by_ns;
            sweep.end_ns += by_ns;
            for beam in &mut sweep.beams {
                beam.stamp_ns += by_ns;
            }
        }
        Event::Imu(sample) => sample.header.stamp_ns += by_ns,
        Event::Twist(twist) => twist.header.stamp_ns += by_ns,
        Event::Truth(pose) => pose.header.stamp_ns += by_ns,
    }
}
