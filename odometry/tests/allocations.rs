//! Steady state allocates nothing. Alone in its file: the allocator is the process's.
#![allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]

use randt_config::Config;
use randt_counting_allocator::{CountingAllocator, allocations};
use randt_filter::ClusterFilter;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints, Topic};
use randt_odometry::{Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, WheelProfile, World};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Counts what comes out, and stores nothing.
#[derive(Default)]
struct Outcome {
    states: u64,
    keyframes: u64,
    submap_id: u64,
}

impl Sink for Outcome {
    fn state(&mut self, state: &OdometryState) {
        self.states += 1;
        self.submap_id = state.submap_id;
    }
    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {
        self.keyframes += 1;
    }
}

#[test]
fn nothing_is_allocated_in_steady_state() {
    // The whole drive is there before the counting begins.
    let robot = Robot {
        wheels: Some(WheelProfile::default()),
        ..Robot::default()
    };
    let events: Vec<Event> = Simulation::new(&World::building(), robot, 250, 3).collect();
    let config = Config::default();
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut points = Message::<RadarPoints>::default();
    // The caller's; on the bus it is shared memory.
    points.items.reserve(RadarPoints::MAX_ITEMS);
    let mut odometry = Odometry::new(&config, true);
    let mut outcome = Outcome::default();
    let mut saved = vec![0; Odometry::STATE_BYTES_MAX];
    let (mut steady, mut allocating) = (0, Vec::with_capacity(events.len()));

    // From one sweep to the next, the IMU samples between them included.
    let mut before = (allocations(), 0, 0);
    for event in &events {
        match event {
            Event::Scan(scan) => {
                filter.process(scan.as_ref(), &mut points);
                odometry.push_points(points.as_ref(), &mut outcome);
                let length = odometry.save(&mut saved).unwrap();
                if outcome.states == 40 {
                    // From here on it is another one, with the same room.
                    odometry = Odometry::restore(&config, true, &saved[..length]).unwrap();
                }
            }
            Event::Imu(sample) => {
                odometry.push_imu(sample, &mut outcome);
                continue;
            }
            Event::Twist(twist) => {
                odometry.push_twist(twist, &mut outcome);
                continue;
            }
            Event::Truth(_) => continue,
        }
        let now = (allocations(), outcome.keyframes, outcome.submap_id);
        // Steady state: after the 50th, no keyframe, no new submap.
        if outcome.states > 50 && (now.1, now.2) == (before.1, before.2) {
            steady += 1;
            if now.0 > before.0 {
                allocating.push((outcome.states, now.0 - before.0));
            }
        }
        before = (allocations(), now.1, now.2);
    }
    assert!(outcome.keyframes > 10, "{} keyframes", outcome.keyframes);
    assert!(steady > 50, "{steady} scans in steady state");
    assert!(
        allocating.is_empty(),
        "of {steady} scans in steady state these allocate (scan, times): {allocating:?}"
    );
}
