//! Trust in single solutions, in a bare corridor, and after a robot was carried elsewhere.

use super::*;
use crate::{Odometry, Sink, localizability::wall_information};
use nalgebra::{Matrix3, Vector3};
use randt_filter::ClusterFilter;
use randt_geometry::elementary::sin;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_ndt::ScanCell;
use randt_persist::{Persist, Reader, Writer};
use randt_simulator::{Event, Robot, Simulation, World};
use std::collections::BTreeMap;

const SWEEP_NS: i64 = 200_000_000;
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
                Event::Truth(_) => {}
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
    let first = states.iter().skip(20).position(weak).unwrap() + 19;
    let blind = states[first + 1..].iter().take_while(|s| weak(s)).count();
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
fn a_robot_that_was_carried_elsewhere_is_doubted_within_a_second() {
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
        Event::Truth(pose) => pose.header.stamp_ns += by_ns,
    }
}

/// A scan of this number, of ten cells.
fn scan(number: i64) -> WindowScan {
    let mut scan = WindowScan {
        cells: vec![ScanCell::default(); 10],
        ..WindowScan::default()
    };
    scan.message.head.sweep.end_ns = number * SWEEP_NS;
    scan
}

/// A solution of this fit with that much information along the weaker direction of the position,
/// 1/m^2.
fn solution(fit: f64, weakest: f64) -> Solution {
    Solution {
        fit,
        scan_information: Matrix3::from_diagonal(&Vector3::new(20_000.0, weakest, 1e5)),
        ..Solution::default()
    }
}

/// Judges a scan by what the window makes of its cells and this solution.
fn judge(
    monitor: &mut TrackingMonitor,
    solution: &Solution,
    mut scan: WindowScan,
    config: &Config,
) -> TrackingStatus {
    let (information, fit) = (&solution.scan_information, solution.fit);
    scan.localizability = Localizability::from_information(information, fit, config);
    monitor.judge(solution, &scan, config)
}

/// Judges scans of these fits, the direction being strong.
fn judged(fits: &[f64]) -> Vec<Trust> {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let judged = |(number, fit)| {
        let solution = solution(fit, 9000.0);
        judge(&mut monitor, &solution, scan(number), &config).trust()
    };
    (0..).zip(fits.iter().copied()).map(judged).collect()
}

#[test]
fn three_poor_fits_of_ten_are_doubted_for_a_second() {
    const GOOD: f64 = 0.41;
    const POOR: f64 = 0.39;
    assert_eq!(judged(&[GOOD; 20]), [Trust::Good; 20]);
    // Two, and a third that comes when the first one is forgotten.
    let mut fits = [GOOD; 30];
    (fits[3], fits[5], fits[13]) = (POOR, POOR, POOR);
    assert_eq!(judged(&fits), [Trust::Good; 30]);
    (fits[3], fits[4], fits[5]) = (POOR, POOR, POOR);
    fits[13] = GOOD;
    let trust = judged(&fits);
    // Doubted from the third one until a second after the first one is forgotten, eight scans
    // later.
    let doubted = (0..).zip(&trust).filter(|(_, t)| **t == Trust::Degraded);
    let doubted: Vec<usize> = doubted.map(|(scan, _)| scan).collect();
    assert_eq!(doubted, Vec::from_iter(5..=16));
    assert!(trust[17..].iter().all(|trust| *trust == Trust::Good));
}

#[test]
fn a_poor_fit_is_as_poor_under_every_loss() {
    let fit = |alpha: f64, scale: f64| {
        let mut config = Config::default();
        (config.odometry.loss_alpha, config.odometry.loss_scale) = (alpha, scale);
        fit_min(&config)
    };
    let close = |fit: f64, expected: f64| assert!((fit - expected).abs() < 0.001, "{fit}");
    // The profiles mixed, indoor, outdoor and oxford.
    close(fit(-1.5, 2.0), 0.400);
    close(fit(-2.0, 1.5), 0.233);
    close(fit(-1.0, 2.0), 0.413);
    close(fit(-2.0, 1.0), 0.086);
}

#[test]
fn a_weak_direction_is_known_by_cell_weight_and_slack() {
    let trust = |weakest: f64, change: fn(&mut Config)| {
        let mut config = Config::default();
        change(&mut config);
        let mut monitor = TrackingMonitor::default();
        let status = judge(&mut monitor, &solution(0.8, weakest), scan(0), &config);
        status.trust()
    };
    // 5.6 x 6 x 200 x 0.8 / 6 = 896.
    assert_eq!(trust(905.0, |_| ()), Trust::Good);
    assert_eq!(trust(885.0, |_| ()), Trust::Degraded);
    for (limit, change) in [
        (3584.0, (|c| c.ndt.cell_size_m = 0.5) as fn(&mut Config)),
        (448.0, |c| c.odometry.ndt_weight = 100.0),
        (5376.0, |c| c.ndt.slack = 0.0),
        (224.0, |c| c.sensor.cell_size_min_m = 2.0),
    ] {
        assert_eq!(trust(1.01 * limit, change), Trust::Good, "{limit}");
        assert_eq!(trust(0.99 * limit, change), Trust::Degraded, "{limit}");
    }
}

#[test]
fn a_sweep_of_two_senders_is_doubted_for_a_second() {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let trust: Vec<Trust> = (0..20)
        .map(|number| {
            let mut scan = scan(number);
            let sweep = &mut scan.message.head.sweep;
            sweep.contested = u64::from(number == 7);
            judge(&mut monitor, &solution(0.8, 9000.0), scan, &config).trust()
        })
        .collect();
    let doubted = (0..).zip(&trust).filter(|(_, t)| **t == Trust::Degraded);
    let doubted: Vec<usize> = doubted.map(|(scan, _)| scan).collect();
    assert_eq!(doubted, Vec::from_iter(7..=11));
}

#[test]
fn what_is_doubted_has_its_reasons_and_what_is_good_has_none() {
    use TrustReason::{Contested, Fit, Held, Rate, Unsupported, Weak};
    type Change = fn(&mut Solution, &mut WindowScan);
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let same: Change = |_, _| ();
    let poor: Change = |solution, _| solution.fit = 0.2;
    let weak: Change = |solution, _| solution.scan_information.m22 = 100.0;
    let few: Change = |solution, _| solution.fit = 0.0;
    let adrift: Change = |solution, _| {
        solution.fit = 0.0;
        (solution.covariance[(0, 0)], solution.covariance[(1, 1)]) = (1.0, 57.0);
    };
    let contested: Change = |_, scan| scan.message.head.sweep.contested = 1;
    let fast: Change = |_, scan| scan.state.velocity.x = 100.0;
    let steps: [(Change, &[TrustReason], Trust, Seen); 14] = [
        (same, &[], Trust::Good, Seen::Full),
        (weak, &[Weak], Trust::Degraded, Seen::Partial),
        (same, &[Held], Trust::Degraded, Seen::Full),
        (contested, &[Contested], Trust::Degraded, Seen::Full),
        (poor, &[Held], Trust::Degraded, Seen::Full),
        (poor, &[Held], Trust::Degraded, Seen::Full),
        (poor, &[Fit], Trust::Degraded, Seen::Full),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        // Motion model and IMU carry the pose as long as they know it well enough.
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (adrift, &[Unsupported, Fit], Trust::Lost, Seen::None),
        (fast, &[Fit, Rate], Trust::Lost, Seen::Full),
    ];
    for (number, (change, reasons, trust, seen)) in (0..).zip(steps) {
        let (mut solution, mut scan) = (solution(0.8, 9000.0), scan(number));
        change(&mut solution, &mut scan);
        let status = judge(&mut monitor, &solution, scan, &config);
        let found: Vec<_> = TrustReason::in_set(status.reasons).collect();
        assert_eq!((&found[..], status.trust()), (reasons, trust), "{number}");
        assert_eq!(status.localizability, seen as u32, "{number}");
        // The diagonal's weaker one is along y.
        let is_sideways = status.weak_direction_rad.abs() == std::f64::consts::FRAC_PI_2;
        assert_eq!(is_sideways, seen == Seen::Partial, "{number}");
    }
}

#[test]
fn where_the_position_drifted_trust_comes_back_after_its_metres() {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let mut judged = |number: i64, weakest: f64, variance_m2: f64| {
        let mut scan = scan(number);
        (scan.state.velocity.x, scan.dt_s) = (1.0, 0.2);
        let mut solution = solution(0.8, weakest);
        solution.covariance[(1, 1)] = variance_m2;
        let trust = judge(&mut monitor, &solution, scan, &config).trust();
        let position = solution.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        (trust, monitor.widen(&position, &Pose2::IDENTITY))
    };
    // Ten scans drift by 0.4 m; then all directions are seen again.
    for number in 0..10 {
        judged(number, 100.0, 0.016 * (number + 1) as f64);
    }
    let after: Vec<_> = (10..60)
        .map(|number| judged(number, 9000.0, 1e-4))
        .collect();
    let doubted = after
        .iter()
        .take_while(|(trust, _)| *trust == Trust::Degraded);
    let doubted = doubted.count();
    assert!((17..=25).contains(&doubted), "{doubted} scans of 0.2 m");
    assert!(
        after[doubted..]
            .iter()
            .all(|(trust, _)| *trust == Trust::Good)
    );
    // As long as it is within the metres, its covariance is published.
    assert!((after[0].1.m22 - 0.16).abs() < 1e-9 && after[0].1.m11 < 1e-9);
    assert!((after[49].1.m22 - 1e-4).abs() < 1e-12);
}

#[test]
fn what_is_remembered_survives_its_process() {
    let config = Config::default();
    let fits = [
        0.3, 0.8, 0.3, 0.8, 0.8, 0.3, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8,
    ];
    let (mut whole, mut killed) = (TrackingMonitor::default(), TrackingMonitor::default());
    for (number, fit) in (0..).zip(fits) {
        let judge = |monitor: &mut TrackingMonitor| {
            monitor.judge(&solution(fit, 9000.0), &scan(number), &config)
        };
        assert_eq!(judge(&mut whole), judge(&mut killed), "scan {number}");
        let mut bytes = [0; 512];
        killed.save(&mut Writer::new(&mut bytes));
        killed = TrackingMonitor::default();
        killed.restore(&mut Reader::new(&bytes)).unwrap();
    }
    // More scans than are remembered cannot have been.
    let mut bytes = [0xff; 512];
    TrackingMonitor::default().save(&mut Writer::new(&mut bytes));
    bytes[4..8].copy_from_slice(&(1_u32 << FIT_SCANS).to_le_bytes());
    assert!(killed.restore(&mut Reader::new(&bytes)).is_err());
}
