//! Simulated drives as odometry publishes them, with the truth behind each keyframe: for the
//! mapper's tests and benchmarks.
#![allow(
    clippy::unwrap_used,
    reason = "only tests and benchmarks drive: a panic says what is wrong"
)]

use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, RadarPoints};
use randt_odometry::{Odometry, Sink};
use randt_simulator::{Event, Robot, START_NS, Simulation, World};
use std::collections::BTreeMap;
use std::ops::Range;

/// Keyframes in order, and where the robot truly was at each one's stamp.
pub struct Drive {
    /// What odometry published.
    pub keyframes: Vec<Message<Keyframe>>,
    truth: BTreeMap<i64, Pose2>,
}

#[derive(Default)]
struct KeyframeLog(Vec<Message<Keyframe>>);

impl Sink for KeyframeLog {
    fn state(&mut self, _: &OdometryState) {}
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        let mut message = Message::default();
        *message.head = *keyframe.head;
        message.items.extend_from_slice(keyframe.items);
        self.0.push(message);
    }
}

/// The configuration for a world's robot.
pub fn config(world: &World) -> Config {
    let mounting = Robot::for_world(world).radar_mounting;
    let mut config = Config::default();
    config.robot.radar_x_m = mounting.x_m;
    config.robot.radar_y_m = mounting.y_m;
    config
}

impl Drive {
    /// A drive of this many sweeps through a world. In a blackout (s since the start) the sensors
    /// are silent.
    pub fn new(world: &World, scans: u64, seed: u64, blackouts_s: &[Range<f64>]) -> Self {
        let events = Simulation::new(world, Robot::for_world(world), scans, seed);
        Self::from_events(world, events, blackouts_s)
    }

    /// A drive of this many sweeps through a world that becomes another one of the same route after
    /// some of them.
    pub fn through_change(worlds: [&World; 2], change: u64, scans: u64, seed: u64) -> Self {
        let [before, after] =
            worlds.map(|world| Simulation::new(world, Robot::for_world(world), scans, seed));
        let mut scans_left = change;
        let is_before = |event: &Event| {
            let is_changed = scans_left == 0;
            scans_left = scans_left.saturating_sub(u64::from(matches!(event, Event::Scan(_))));
            !is_changed
        };
        let before: Vec<Event> = before.take_while(is_before).collect();
        let after = after.skip(before.len());
        Self::from_events(worlds[0], before.into_iter().chain(after), &[])
    }

    fn from_events(
        world: &World,
        events: impl Iterator<Item = Event>,
        blackouts_s: &[Range<f64>],
    ) -> Self {
        let config = config(world);
        let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
        let mut points = Message::<RadarPoints>::default();
        let mut odometry = Odometry::new(&config, true);
        let (mut log, mut truth) = (KeyframeLog::default(), BTreeMap::new());
        for event in events {
            let time_s = (event.stamp_ns() - START_NS) as f64 * 1e-9;
            let is_dark = blackouts_s
                .iter()
                .any(|blackout| blackout.contains(&time_s));
            match event {
                Event::Truth(pose) => {
                    truth.insert(pose.header.stamp_ns, Pose2::from_array(pose.pose));
                }
                _ if is_dark => {}
                Event::Scan(scan) => {
                    filter.process(scan.as_ref(), &mut points);
                    odometry.push_points(points.as_ref(), &mut log);
                }
                Event::Imu(sample) => odometry.push_imu(&sample, &mut log),
                Event::Twist(twist) => odometry.push_twist(&twist, &mut log),
            }
        }
        odometry.finish(&mut log);
        Self {
            keyframes: log.0,
            truth,
        }
    }

    /// Where the robot truly was.
    pub fn truth(&self, stamp_ns: i64) -> Pose2 {
        *self.truth.get(&stamp_ns).unwrap()
    }
}
