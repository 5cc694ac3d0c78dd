//! A simulated drive as odometry gets it, and all that comes out.
#![allow(dead_code, reason = "not every test uses every part")]

use randt_config::Config;
use randt_filter::ClusterFilter;
use randt_messages::{
    ImuSample, Keyframe, Message, MessageRef, OdometryState, OdometryStateTopic, RadarPoints, Twist,
};
use randt_odometry::{Counters, Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, WheelProfile, World};

/// What odometry takes.
#[derive(Clone, Debug)]
pub enum Input {
    /// A filtered scan.
    Points(Message<RadarPoints>),
    /// A sample.
    Imu(ImuSample),
    /// A twist.
    Twist(Twist),
}

impl Input {
    /// Gives it to odometry.
    pub fn push(&self, odometry: &mut Odometry, sink: &mut impl Sink) {
        match self {
            Self::Points(scan) => odometry.push_points(scan.as_ref(), sink),
            Self::Imu(sample) => odometry.push_imu(sample, sink),
            Self::Twist(twist) => odometry.push_twist(twist, sink),
        }
    }
}

/// As simulated: the radar sits before the robot's middle.
pub fn config() -> Config {
    let mounting = Robot::default().radar_mounting;
    let mut config = Config::default();
    (config.robot.radar_x_m, config.robot.radar_y_m) = (mounting.x_m, mounting.y_m);
    config
}

/// The same without a gyro that bridges gaps: those of a drive open frames.
pub fn config_that_bridges_no_gap() -> Config {
    let mut config = config();
    config.odometry.gap_with_gyro_max_s = config.odometry.gap_max_s;
    config
}

/// A drive through the building: standstill, then turns and corridors. With wheel odometry.
pub fn inputs(scans: u64) -> Vec<Input> {
    let config = config();
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let robot = Robot {
        wheels: Some(WheelProfile::default()),
        ..Robot::default()
    };
    let events = Simulation::new(&World::building(), robot, scans, 5);
    let mut inputs = Vec::new();
    for event in events {
        match event {
            Event::Scan(scan) => {
                let mut points = Message::default();
                filter.process(scan.as_ref(), &mut points);
                inputs.push(Input::Points(points));
            }
            Event::Imu(sample) => inputs.push(Input::Imu(sample)),
            Event::Twist(twist) => inputs.push(Input::Twist(twist)),
            Event::Truth(_) => {}
        }
    }
    inputs
}

/// Index of a scan among the inputs.
pub fn index_of(inputs: &[Input], scan: usize) -> usize {
    let scans = inputs
        .iter()
        .enumerate()
        .filter(|(_, input)| matches!(input, Input::Points(_)));
    scans.map(|(index, _)| index).nth(scan).unwrap()
}

/// Moves an input in time.
pub fn shift(input: &mut Input, by_ns: i64) {
    match input {
        Input::Points(scan) => shift_scan(scan, by_ns),
        Input::Imu(sample) => sample.header.stamp_ns += by_ns,
        Input::Twist(twist) => twist.header.stamp_ns += by_ns,
    }
}

/// Moves a scan in time, its beams included.
pub fn shift_scan(scan: &mut Message<RadarPoints>, by_ns: i64) {
    scan.head.header.stamp_ns += by_ns;
    let sweep = &mut scan.head.sweep;
    sweep.begin_ns += by_ns;
    sweep.end_ns += by_ns;
    let count = sweep.beam_count as usize;
    sweep.beams[..count]
        .iter_mut()
        .for_each(|beam| beam.stamp_ns += by_ns);
}

/// Everything that comes out, in order.
#[derive(Default)]
pub struct Outcome {
    pub states: Vec<OdometryState>,
    pub keyframes: Vec<Message<Keyframe>>,
    pub bytes: Vec<u8>,
    pub counters: Counters,
}

impl Sink for Outcome {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(*state);
        let message = MessageRef::<OdometryStateTopic> {
            head: state,
            items: &[],
        };
        message.write_bytes(&mut self.bytes);
    }
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        keyframe.write_bytes(&mut self.bytes);
        self.keyframes.push(Message {
            head: Box::new(*keyframe.head),
            items: keyframe.items.to_vec(),
        });
    }
}
