//! What odometry does at starts and stops, at gaps, with a late IMU and without one.

use crate::support::{Input, config, inputs, shift_scan};
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_messages::{ImuUse, Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Counters, Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, World};
use std::sync::LazyLock;

/// Standstill ends here, as the simulated driver has it; 5 sweeps a second.
const STANDING_SCANS: usize = 12;
const SECOND_NS: i64 = 1_000_000_000;

/// 14 s: standstill, then the drive.
static DRIVE: LazyLock<Vec<Event>> = LazyLock::new(|| drive(70));

fn drive(scans: u64) -> Vec<Event> {
    Simulation::new(&World::building(), Robot::default(), scans, 5).collect()
}

/// Everything that comes out, in order.
#[derive(Default)]
pub struct Outcome {
    pub states: Vec<OdometryState>,
    keyframes: Vec<(u64, i64)>,
    bytes: Vec<u8>,
    counters: Counters,
}

impl Sink for Outcome {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(*state);
        let message = MessageRef::<randt_messages::OdometryStateTopic> {
            head: state,
            items: &[],
        };
        message.write_bytes(&mut self.bytes);
    }
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.keyframes
            .push((keyframe.head.odom_frame_id, keyframe.head.header.stamp_ns));
        keyframe.write_bytes(&mut self.bytes);
    }
}

impl Outcome {
    /// Frame and number of scans, in order.
    fn frames(&self) -> Vec<(u64, usize)> {
        let chunks = self
            .states
            .chunk_by(|a, b| a.odom_frame_id == b.odom_frame_id);
        chunks
            .map(|chunk| (chunk[0].odom_frame_id, chunk.len()))
            .collect()
    }

    fn imu_use(&self, wanted: ImuUse) -> usize {
        self.states
            .iter()
            .filter(|state| state.imu_use == wanted as u32)
            .count()
    }
}

/// Filter and odometry over events; `after` sees what is out after each of them.
fn watched(events: &[Event], use_imu: bool, mut after: impl FnMut(&Event, &Outcome)) -> Outcome {
    let config = config();
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    let mut odometry = Odometry::new(&config, use_imu);
    let mut outcome = Outcome::default();
    for event in events {
        match event {
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut outcome);
            }
            Event::Imu(sample) => odometry.push_imu(sample, &mut outcome),
            Event::Twist(twist) => odometry.push_twist(twist, &mut outcome),
            Event::Truth(_) => continue,
        }
        after(event, &outcome);
    }
    odometry.finish(&mut outcome);
    outcome.counters = odometry.counters();
    outcome
}

pub fn run(events: &[Event]) -> Outcome {
    watched(events, true, |_, _| {})
}

/// Moves an event in time, its beams included.
fn shift(event: &mut Event, by_ns: i64) {
    match event {
        Event::Scan(scan) => {
            scan.head.header.stamp_ns += by_ns;
            let sweep = &mut scan.head.sweep;
            sweep.begin_ns += by_ns;
            sweep.end_ns += by_ns;
            sweep
                .beams
                .iter_mut()
                .for_each(|beam| beam.stamp_ns += by_ns);
        }
        Event::Imu(sample) => sample.header.stamp_ns += by_ns,
        Event::Twist(twist) => twist.header.stamp_ns += by_ns,
        Event::Truth(pose) => pose.header.stamp_ns += by_ns,
    }
}

/// Index of a scan among the events.
fn index_of(events: &[Event], scan: usize) -> usize {
    let scans = events
        .iter()
        .enumerate()
        .filter(|(_, event)| matches!(event, Event::Scan(_)));
    scans.map(|(index, _)| index).nth(scan).unwrap()
}

/// True poses at the sweeps' ends.
fn truth(events: &[Event]) -> Vec<Pose2> {
    let mut last = Pose2::IDENTITY;
    let mut poses = Vec::new();
    for event in events {
        match event {
            Event::Truth(truth) => last = Pose2::from_array(truth.pose),
            Event::Scan(_) => poses.push(last),
            Event::Imu(_) | Event::Twist(_) => {}
        }
    }
    poses
}

/// Largest distance from the truth, both from their first poses, m.
fn error_m(states: &[OdometryState], truth: &[Pose2]) -> f64 {
    let first = Pose2::from_array(states[0].pose);
    let error = |(state, true_pose): (&OdometryState, &Pose2)| {
        let moved = first.between(&Pose2::from_array(state.pose));
        (moved.translation() - truth[0].between(true_pose).translation()).norm()
    };
    states.iter().zip(truth).map(error).fold(0.0, f64::max)
}

#[test]
fn every_scan_has_its_pose_near_the_truth() {
    let outcome = run(&DRIVE);
    assert_eq!(outcome.frames(), [(0, 70)]);
    assert_eq!(outcome.imu_use(ImuUse::Covered), 70);
    let error_m = error_m(&outcome.states, &truth(&DRIVE));
    assert!(error_m < 0.1, "{error_m} m");
    assert_eq!(
        outcome.counters,
        Counters {
            points_outside: outcome.counters.points_outside,
            gyro_largest_mrad_s: outcome.counters.gyro_largest_mrad_s,
            ..Counters::default()
        }
    );
}

#[test]
fn the_same_inputs_give_the_same_bytes() {
    let first = run(&DRIVE).bytes;
    assert!(first.len() > 70 * size_of::<OdometryState>());
    assert!(first == run(&DRIVE).bytes);
}

#[test]
fn a_start_at_speed_is_found_from_two_scans() {
    // The log begins on the way, where the robot is at its fastest.
    let events = drive(120);
    let poses = truth(&events);
    let speed =
        |scan: usize| (poses[scan].translation() - poses[scan - 1].translation()).norm() * 5.0;
    let from = (STANDING_SCANS..90)
        .max_by(|a, b| speed(*a).total_cmp(&speed(*b)))
        .unwrap();
    assert!(speed(from) > 0.8, "{} m/s", speed(from));
    // Cut before the sweep, so that the gyro covers it.
    let begin = index_of(&events, from - 2) + 1;
    let outcome = run(&events[begin..index_of(&events, from + 25) + 10]);
    let error_m = error_m(&outcome.states, &poses[from - 1..]);
    assert_eq!(outcome.frames(), [(0, 27)]);
    // No standstill has shown the gyro's bias: along a corridor the heading drifts until it is
    // known.
    assert!(error_m < 0.2, "{error_m} m");
    let found_m_s = outcome.states[3].velocity[0];
    assert!(
        (found_m_s - speed(from + 2)).abs() < 0.15,
        "{found_m_s} m/s, truly {}",
        speed(from + 2)
    );
}

#[test]
fn standstill_makes_no_keyframes_and_no_way() {
    let poses = truth(&DRIVE);
    let standing = poses.iter().take_while(|pose| **pose == poses[0]).count();
    assert!(standing >= 10, "{standing} scans while standing");
    let outcome = run(&DRIVE[..=index_of(&DRIVE, standing - 1)]);
    assert_eq!(outcome.states.len(), standing);
    assert_eq!(
        outcome.keyframes.len(),
        1,
        "only the one that initialises the map"
    );
    for (number, state) in outcome.states.iter().enumerate() {
        let moved_m = Pose2::from_array(state.pose).translation().norm();
        assert!(
            moved_m < 0.03,
            "{moved_m} m at scan {number} while standing"
        );
    }
}

#[test]
fn a_long_gap_opens_a_new_frame_and_one_that_the_gyro_bridges_does_not() {
    let without = |gap: std::ops::Range<usize>| {
        let mut number = 0;
        let kept = DRIVE.iter().filter(|event| {
            let is_scan = matches!(event, Event::Scan(_));
            number += usize::from(is_scan);
            !(is_scan && gap.contains(&(number - 1)))
        });
        kept.cloned().collect::<Vec<_>>()
    };
    // Sixteen scans missing: 3.4 s from the last to the next.
    let outcome = run(&without(30..46));
    assert_eq!(outcome.frames(), [(0, 30), (1, 24)]);
    assert_eq!(outcome.counters.frames_reopened, 1);
    let second = &outcome.states[30..];
    assert_eq!(second[0].pose, [0.0; 3], "a frame begins at its own origin");
    assert!(error_m(second, &truth(&DRIVE)[46..]) < 0.1);
    assert!(outcome.keyframes.iter().any(|(frame, _)| *frame == 1));
    // Six: 1.4 s, bridged by gyro and registration.
    let outcome = run(&without(30..36));
    assert_eq!(outcome.frames(), [(0, 64)]);
    let true_poses = [&truth(&DRIVE)[..30], &truth(&DRIVE)[36..]].concat();
    assert!(error_m(&outcome.states, &true_poses) < 0.1);
    // Without a gyro that is too long.
    let mut events = without(30..36);
    events.retain(|event| !matches!(event, Event::Imu(_)));
    assert_eq!(run(&events).frames(), [(0, 30), (1, 34)]);
}

#[test]
fn a_clock_that_is_set_back_opens_a_new_frame() {
    for seconds in [2, 5000] {
        let mut events = DRIVE.clone();
        let from = index_of(&events, 34) + 1;
        events[from..]
            .iter_mut()
            .for_each(|event| shift(event, -seconds * SECOND_NS));
        let outcome = run(&events);
        assert_eq!(outcome.frames(), [(0, 35), (1, 35)], "{seconds} s");
        let error_m = error_m(&outcome.states[35..], &truth(&DRIVE)[35..]);
        assert!(error_m < 0.1, "{error_m} m");
        // The gyro goes on in the new time.
        assert!(
            outcome.imu_use(ImuUse::Covered) >= 68,
            "{}",
            outcome.imu_use(ImuUse::Covered)
        );
    }
}

#[test]
fn a_repeated_scan_is_left_out_and_counted() {
    let mut events = DRIVE.clone();
    let twice = index_of(&events, 30);
    let again = events[twice].clone();
    events.insert(twice + 1, again);
    let outcome = run(&events);
    assert_eq!(outcome.frames(), [(0, 70)]);
    assert_eq!(outcome.counters.scans_repeated, 1);
    let plain = run(&DRIVE);
    let poses = |outcome: &Outcome| outcome.states.iter().map(|s| s.pose).collect::<Vec<_>>();
    assert_eq!(poses(&outcome), poses(&plain));
}

#[test]
fn without_an_imu_no_scan_is_delayed() {
    let mut scans = 0;
    let outcome = watched(&DRIVE, false, |event, outcome| {
        scans += usize::from(matches!(event, Event::Scan(_)));
        assert_eq!(outcome.states.len(), scans, "a state at once");
    });
    assert_eq!(outcome.imu_use(ImuUse::None), 70);
    assert!(error_m(&outcome.states, &truth(&DRIVE)) < 0.15);
}

#[test]
fn an_imu_that_never_speaks_delays_a_scan_by_no_more_than_the_next() {
    let events: Vec<Event> = DRIVE
        .iter()
        .filter(|event| !matches!(event, Event::Imu(_)))
        .cloned()
        .collect();
    let mut scans = 0;
    let outcome = watched(&events, true, |event, outcome| {
        scans += usize::from(matches!(event, Event::Scan(_)));
        assert!(
            outcome.states.len() + 1 >= scans,
            "{} of {scans}",
            outcome.states.len()
        );
    });
    assert_eq!(
        (outcome.frames(), outcome.imu_use(ImuUse::None)),
        (vec![(0, 70)], 70)
    );
}

#[test]
fn an_imu_that_stops_and_comes_back_is_counted() {
    let (from, to) = (index_of(&DRIVE, 29) + 1, index_of(&DRIVE, 44));
    let events: Vec<Event> = DRIVE
        .iter()
        .enumerate()
        .filter(|(i, event)| !((from..to).contains(i) && matches!(event, Event::Imu(_))))
        .map(|(_, event)| event.clone())
        .collect();
    let outcome = run(&events);
    assert_eq!(outcome.frames(), [(0, 70)]);
    let covered = outcome.imu_use(ImuUse::Covered);
    assert!(
        (53..=56).contains(&covered),
        "{covered} of 70 scans covered"
    );
    assert!(outcome.counters.imu_holes >= 1);
    assert!(error_m(&outcome.states, &truth(&DRIVE)) < 0.15);
}

/// The drive with every IMU sample delivered later than it was taken.
fn delayed(by_ns: i64) -> Vec<Event> {
    let due = |event: &Event| match event {
        Event::Imu(_) => event.stamp_ns() + by_ns,
        _ => event.stamp_ns(),
    };
    let mut events = DRIVE.clone();
    events.sort_by_key(due);
    events
}

#[test]
fn a_late_imu_is_waited_for_and_changes_nothing() {
    let plain = run(&DRIVE);
    // 60 ms late: within the wait.
    let late = run(&delayed(60_000_000));
    assert_eq!(late.imu_use(ImuUse::Covered), 70);
    let poses = |outcome: &Outcome| outcome.states.iter().map(|s| s.pose).collect::<Vec<_>>();
    assert_eq!(
        poses(&late),
        poses(&plain),
        "arrival does not change the result"
    );
}

#[test]
fn the_wait_for_a_late_imu_is_bounded_and_counted() {
    // Half a second late: no scan is covered when its wait is over.
    let events = delayed(SECOND_NS / 2);
    let mut scans = Vec::new();
    let mut most = 0;
    let outcome = watched(&events, true, |event, outcome| {
        if let Event::Scan(scan) = event {
            scans.push(scan.head.header.stamp_ns);
        }
        most = most.max(scans.len() - outcome.states.len());
    });
    assert!(most <= 4, "{most} scans waited at once");
    assert_eq!(outcome.states.len(), 70);
    let without = outcome.imu_use(ImuUse::Late) + outcome.imu_use(ImuUse::None);
    assert!(without >= 65, "{without} of 70 scans");
    assert!(error_m(&outcome.states, &truth(&DRIVE)) < 0.15);
}

#[test]
fn a_radar_whose_lateness_is_known_is_not_late() {
    let late_ns = 100_000_000;
    let outcome = |radar_late_s: f64, shifted_ns: i64| {
        let mut config = config();
        config.odometry.radar_late_s = radar_late_s;
        let mut odometry = Odometry::new(&config, true);
        let mut outcome = crate::support::Outcome::default();
        for mut input in inputs(40) {
            if let Input::Points(scan) = &mut input {
                shift_scan(scan, shifted_ns);
            }
            input.push(&mut odometry, &mut outcome);
        }
        odometry.finish(&mut outcome);
        outcome
    };
    let plain = outcome(0.0, 0);
    assert!(outcome(0.1, late_ns).bytes == plain.bytes);
    assert!(outcome(0.0, late_ns).bytes != plain.bytes);
}
