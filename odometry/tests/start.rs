//! What is published before there is a pose.

use crate::support::config;
use randt_filter::ClusterFilter;
use randt_geometry::elementary;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints, Trust};
use randt_odometry::{Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, World};

#[derive(Default)]
struct States(Vec<OdometryState>);

impl Sink for States {
    fn state(&mut self, state: &OdometryState) {
        self.0.push(*state);
    }
    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

impl States {
    fn from_events(events: &[Event]) -> Self {
        let config = config();
        let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
        let mut points = Message::<RadarPoints>::default();
        let mut odometry = Odometry::new(&config, true);
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
        states
    }
}

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
    let states = States::from_events(&events);
    let waiting = states.0.iter().filter(|s| s.trust() == Trust::Lost);
    let waiting: Vec<&OdometryState> = waiting.collect();
    // The first scan with returns shows nothing by itself.
    assert_eq!(waiting.len(), 61);
    let true_yaw = |state: &OdometryState| {
        let stamp_ns = state.header.stamp_ns;
        let found = truths.iter().find(|(then_ns, _)| *then_ns == stamp_ns);
        found.unwrap().1[2]
    };
    let first = true_yaw(&states.0[0]);
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
    // Then it begins, in the same frame and at that heading.
    assert!(states.0.iter().all(|state| state.odom_frame_id == 0));
    let last = states.0.last().unwrap();
    assert_ne!(last.trust(), Trust::Lost);
    let off_rad = elementary::wrap(last.pose[2] - (true_yaw(last) - first));
    assert!(off_rad.abs() < 1_f64.to_radians(), "{off_rad} rad off");
}
