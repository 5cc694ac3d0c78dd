//! A drive as a stream of sensor messages, in order of their instants, with the truth.

use crate::caster::Caster;
use crate::inertial::Imu;
use crate::radar::Radar;
use crate::wheels::Wheels;
use crate::{
    BeamSurface, Drive, Ground, ImuProfile, MotionProfile, RadarProfile, WheelProfile, World,
};
use randt_geometry::Pose2;
use randt_messages::{Event, Header, Message, RadarScan, SensorKind, TruthPose};

/// Stamps of a simulated drive begin here: a round date, as in a real recording.
pub const START_NS: i64 = 1_700_000_000_000_000_000;
/// Time between truths besides those at the sweeps' ends.
const TRUTH_NS: i64 = 20_000_000;
/// The IMU goes on for this time after the last sweep: odometry waits for its samples.
const TAIL_NS: i64 = 20_000_000;

/// The robot's sensors and its way of driving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// The radar.
    pub radar: RadarProfile,
    /// The radar in `base_link`.
    pub radar_mounting: Pose2,
    /// How late the radar's clock is against the gyro's and the truth's: its stamps are this much
    /// later.
    pub radar_late_ns: i64,
    /// The IMU; it sits upright in the middle of `base_link`.
    pub imu: ImuProfile,
    /// Wheel odometry, where the robot has it.
    pub wheels: Option<WheelProfile>,
    /// The driver.
    pub motion: MotionProfile,
}

impl Default for Robot {
    /// An iSDR-C 12 cm before the middle of a robot indoors.
    fn default() -> Self {
        Self {
            radar: RadarProfile::isdr_c(),
            radar_mounting: Pose2::new(0.12, 0.0, 0.0),
            radar_late_ns: 0,
            imu: ImuProfile::default(),
            wheels: None,
            motion: MotionProfile::default(),
        }
    }
}

impl Robot {
    /// The robot that drives as fast as a world lets it.
    pub fn for_world(world: &World) -> Self {
        let mut robot = Self::default();
        robot.motion.speed_max_m_s = world.speed_max_m_s;
        robot
    }

    /// The radar's kind.
    pub fn sensor(&self) -> SensorKind {
        self.radar.sensor
    }
}

/// The simulation: an iterator over events. The same world, robot, number and seed give the same
/// bits.
///
/// ```
/// use randt_simulator::{Event, Robot, Simulation, World};
/// let mut scans = 0;
/// for event in Simulation::new(&World::building(), Robot::default(), 2, 7) {
///     if let Event::Scan(scan) = event {
///         assert_eq!(scan.head.sweep.beams().len(), 220);
///         scans += 1;
///     }
/// }
/// assert_eq!(scans, 2);
/// ```
#[derive(Clone, Debug)]
pub struct Simulation {
    drive: Drive,
    radar: Radar,
    radar_late_ns: i64,
    imu: Imu,
    wheels: Option<Wheels>,
    ground: Ground,
    scans_left: u64,
    end_ns: i64,
    next_truth_ns: i64,
    truths: u64,
    // The sweep whose truth was given already.
    waiting: Option<Message<RadarScan>>,
}

impl Simulation {
    /// A drive of this many sweeps.
    pub fn new(world: &World, robot: Robot, scans: u64, seed: u64) -> Self {
        let (caster, ground) = (Caster::new(&world.walls), world.ground.clone());
        Self {
            drive: Drive::new(world, robot.motion, seed),
            radar: Radar::new(robot.radar, robot.radar_mounting, caster, ground, seed),
            radar_late_ns: robot.radar_late_ns,
            imu: Imu::new(robot.imu, seed),
            wheels: robot.wheels.map(|wheels| Wheels::new(wheels, seed)),
            ground: world.ground.clone(),
            scans_left: scans,
            end_ns: i64::MAX,
            next_truth_ns: 0,
            truths: 0,
            waiting: None,
        }
    }

    /// The same drive, bit for bit, that keeps what [`Simulation::surfaces`] gives.
    pub fn with_surfaces(mut self) -> Self {
        self.radar.record_surfaces();
        self
    }

    /// The walls that the latest sweep shows, in order of its beams; none without
    /// [`Simulation::with_surfaces`].
    pub fn surfaces(&self) -> &[BeamSurface] {
        self.radar.surfaces()
    }

    /// Path driven up to the latest event, m.
    pub fn path_m(&mut self) -> f64 {
        let now_ns = self.next_truth_ns.saturating_sub(TRUTH_NS);
        self.drive.at(now_ns).path_m
    }

    fn truth(&mut self, time_ns: i64) -> Event {
        let state = self.drive.at(time_ns);
        let header = Header {
            sequence: self.truths,
            stamp_ns: START_NS + time_ns,
            ..Header::default()
        };
        self.truths += 1;
        let (pose, velocity) = (state.pose2().to_array(), state.velocity);
        Event::Truth(TruthPose {
            header,
            pose,
            velocity,
        })
    }

    /// The sweep that ends next, with stamps; its truth goes first.
    fn sweep(&mut self) -> Event {
        let mut scan = self.radar.sweep(&mut self.drive);
        let relative_ns = scan.head.header.stamp_ns;
        let shift_ns = START_NS + self.radar_late_ns;
        scan.head.header.stamp_ns += shift_ns;
        scan.head.sweep.begin_ns += shift_ns;
        scan.head.sweep.end_ns += shift_ns;
        let count = scan.head.sweep.beam_count as usize;
        for beam in scan.head.sweep.beams.iter_mut().take(count) {
            beam.stamp_ns += shift_ns;
        }
        self.scans_left -= 1;
        if self.scans_left == 0 {
            self.end_ns = relative_ns + TAIL_NS;
        }
        self.waiting = Some(scan);
        self.truth(relative_ns)
    }
}

impl Iterator for Simulation {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        if let Some(scan) = self.waiting.take() {
            return Some(Event::Scan(scan));
        }
        let scan_ns = match self.scans_left {
            0 => i64::MAX,
            _ => self.radar.next_ns(),
        };
        let imu_ns = self.imu.next_ns();
        let wheels_ns = self.wheels.as_ref().map_or(i64::MAX, Wheels::next_ns);
        let next_ns = imu_ns.min(scan_ns).min(self.next_truth_ns).min(wheels_ns);
        if next_ns > self.end_ns || (self.scans_left == 0 && self.end_ns == i64::MAX) {
            return None;
        }
        Some(if next_ns == scan_ns {
            self.sweep()
        } else if next_ns == imu_ns {
            let state = self.drive.at(imu_ns);
            let mut sample = self.imu.sample(&state, &self.ground.attitude(&state));
            sample.header.stamp_ns += START_NS;
            sample.arrival_ns += START_NS;
            Event::Imu(sample)
        } else if let Some(wheels) = self.wheels.as_mut().filter(|_| next_ns == wheels_ns) {
            let mut twist = wheels.measure(&self.drive.at(wheels_ns));
            twist.header.stamp_ns += START_NS;
            twist.arrival_ns += START_NS;
            Event::Twist(twist)
        } else {
            self.next_truth_ns += TRUTH_NS;
            self.truth(next_ns)
        })
    }
}
