//! A simulated drive as a log, as it is or corrupted.

use randt_log::{LogFile, Options, ROBOT_METADATA};
use randt_messages::{ImuSampleTopic, MessageRef, TruthPoseTopic, TwistTopic};
use randt_simulator::{Event, Robot, Simulation, World};
use std::path::Path;

/// The events of a drive through the building: 2.5 s of standstill, then up to 1 m/s.
pub fn events(scans: u64) -> Vec<Event> {
    Simulation::new(&World::building(), Robot::default(), scans, 7).collect()
}

/// Moves an event in time, its beams included.
pub fn shift(event: &mut Event, by_ns: i64) {
    match event {
        Event::Scan(scan) => {
            scan.head.header.stamp_ns += by_ns;
            let sweep = &mut scan.head.sweep;
            sweep.begin_ns += by_ns;
            sweep.end_ns += by_ns;
            let count = sweep.beam_count as usize;
            sweep
                .beams
                .iter_mut()
                .take(count)
                .for_each(|beam| beam.stamp_ns += by_ns);
        }
        Event::Imu(sample) => sample.header.stamp_ns += by_ns,
        Event::Twist(twist) => twist.header.stamp_ns += by_ns,
        Event::Truth(pose) => pose.header.stamp_ns += by_ns,
    }
}

/// Writes events as one of our logs.
pub fn write(events: &[Event], path: &Path) {
    let robot = Robot::default();
    let mut log = LogFile::create(path, Options::default()).unwrap();
    let metadata = randt_log::Robot {
        sensor: robot.sensor(),
        radar: Some(robot.radar_mounting.to_array()),
        imu: Some([1.0, 0.0, 0.0, 0.0]),
    };
    log.write_metadata(ROBOT_METADATA, metadata.to_metadata())
        .unwrap();
    for event in events {
        match event {
            Event::Scan(scan) => log.write(scan.as_ref()),
            Event::Imu(sample) => log.write(MessageRef::<ImuSampleTopic> {
                head: sample,
                items: &[],
            }),
            Event::Twist(twist) => log.write(MessageRef::<TwistTopic> {
                head: twist,
                items: &[],
            }),
            Event::Truth(pose) => log.write(MessageRef::<TruthPoseTopic> {
                head: pose,
                items: &[],
            }),
        }
        .unwrap();
    }
    log.finish().unwrap();
}
