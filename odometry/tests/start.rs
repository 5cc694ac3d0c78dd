//! What is published before there is a pose.

use crate::behaviour::run;
use randt_geometry::{Pose2, elementary};
use randt_messages::{OdometryState, Trust};
use randt_simulator::{Event, Robot, Simulation, World};

/// Empty scans of a robot that already turns: no pose, but its heading, which the gyro gives.
#[test]
fn a_frame_waits_for_its_first_scan_and_only_its_heading_goes_on() {
    let world = "wall concrete 0,0 9,0 9,7 0,7 0,0\nroute 2,2 6,2 6,5 2,5";
    let world = World::parse("room", world).unwrap();
    let mut events: Vec<Event> = Simulation::new(&world, Robot::default(), 120, 5).collect();
    let mut empty = 0;
    let mut truths = Vec::new();
    for event in &mut events {
        match event {
            Event::Scan(scan) if empty < 60 => {
                scan.items.clear();
                for beam in &mut scan.head.sweep.beams {
                    beam.first_return = 0;
                }
                empty += 1;
            }
            Event::Truth(truth) => truths.push((truth.header.stamp_ns, truth.pose)),
            _ => (),
        }
    }
    let outcome = run(&events);
    let waiting = outcome.states.iter().filter(|s| s.trust() == Trust::Lost);
    let waiting: Vec<&OdometryState> = waiting.collect();
    // The first scan with returns shows nothing by itself.
    assert_eq!(waiting.len(), 61);
    let true_pose = |state: &OdometryState| {
        let stamp_ns = state.header.stamp_ns;
        let found = truths.iter().find(|(then_ns, _)| *then_ns == stamp_ns);
        found.unwrap().1
    };
    let true_yaw = |state: &OdometryState| true_pose(state)[2];
    let first = true_yaw(&outcome.states[0]);
    let mut turned_most_rad = 0.0_f64;
    for state in &waiting {
        assert!(state.covariance[0] >= 1e6, "a pose that is none");
        assert_eq!(state.pose[..2], [0.0, 0.0]);
        let turned_rad = elementary::wrap(true_yaw(state) - first);
        let off_rad = elementary::wrap(state.pose[2] - turned_rad);
        assert!(off_rad.abs() < 1_f64.to_radians(), "{off_rad} rad off");
        turned_most_rad = turned_most_rad.max(turned_rad.abs());
    }
    assert!(
        turned_most_rad > 0.5,
        "{turned_most_rad} rad: it does not turn"
    );
    // Then it begins, in the same frame, at that heading, and moves as the robot does.
    assert!(outcome.states.iter().all(|state| state.odom_frame_id == 0));
    let begun = &outcome.states[61..];
    assert!(begun.iter().all(|state| state.trust() == Trust::Good));
    let [first, last] = [0, begun.len() - 1].map(|i| {
        let pose = Pose2::from_array(begun[i].pose);
        (pose, Pose2::from_array(true_pose(&begun[i])))
    });
    let (moved, truly) = (first.0.between(&last.0), first.1.between(&last.1));
    let off = truly.between(&moved);
    assert!(off.translation().norm() < 0.1, "{off:?} after {truly:?}");
    assert!(off.yaw_rad.abs() < 1_f64.to_radians(), "{off:?}");
    assert!(
        truly.translation().norm() > 2.0,
        "{truly:?}: it does not move"
    );
}
