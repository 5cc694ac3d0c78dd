//! Sensors that lie, a world that moves along or jumps: faults that change a drive's events on
//! their way into the pipeline.
//!
//! Each is made of a seed: onset, and what is random in it. The same seed gives the same events.

mod imu;
mod injector;
mod radar;
mod returns;
mod surroundings;

pub use injector::{Change, FaultInjector, Injection, Span};

use randt_simulator::{Random, Robot};
use std::fmt;

/// Random numbers of a fault are none of the simulation's.
const STREAM: u64 = 0xfa17;
/// A fault with an onset begins within these limits after the drive, s: behind the standstill at
/// the start, and with enough of the drive left to come back.
const ONSET_S: [f64; 2] = [30.0, 60.0];
/// Spins: as fast as a robot turns on the spot, rad/s.
const SPIN_RAD_S: f64 = 2.5;

/// What is wrong with a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Fault {
    /// Nothing.
    None,
    /// Two vehicles drive along for 20 s, 3 m ahead and behind.
    Convoy,
    /// Another radar's bursts for 20 s: returns at random ranges in a sector.
    Interference,
    /// The robot is carried on for half a minute without a word: the log is spliced.
    Kidnapped,
    /// The radar repeats one scan for 3 s.
    #[value(name = "frozen-3")]
    Frozen3,
    /// The radar repeats one scan for 10 s.
    #[value(name = "frozen-10")]
    Frozen10,
    /// Drops in every beam.
    Rain,
    /// Echoes at twice the range, stronger than the first one, in one beam of seven.
    Ghosts,
    /// Six people walk around the robot.
    People,
    /// Every scan lacks 30 % of its beams.
    BeamsLost,
    /// A quarter of the circle is hidden.
    Sector,
    /// Stamps of scans are off by up to 15 ms.
    Jitter,
    /// One scan in twenty is missing, and a second every 20 s.
    Gaps,
    /// The robot stops often and turns on the spot at 2.5 rad/s.
    Spins,
    /// The IMU is mounted upside down.
    ImuUpsideDown,
    /// The sign of the yaw rate is turned.
    YawSign,
    /// The radar turns the other way round.
    RadarMirrored,
    /// The gyro's rates are in degrees/s.
    GyroDegrees,
    /// The acceleration comes without gravity.
    NoGravity,
    /// The gyro saturates at 0.35 rad/s.
    GyroSaturated,
    /// The gyro repeats one rate for 20 s.
    GyroFrozen,
    /// One rate in 500 is off by 5 rad/s.
    GyroSpikes,
    /// The gyro's bias steps by 1 degree/s.
    BiasStep,
    /// The gyro's bias grows by 1 degree/s in 100 s.
    BiasCreep,
    /// The gyro's scale is off by 2 %.
    GyroScale,
    /// The IMU's clock steps by 0.3 s.
    ClockStep,
    /// The IMU's stamps are 50 ms late.
    #[value(name = "imu-late")]
    ImuLate,
    /// The gyro has a bias of 0.5 degrees/s.
    BiasConstant,
    /// The noise of the IMU is ten times as large.
    ImuNoise,
    /// The IMU sends nothing for 3 s.
    ImuGap,
    /// The IMU sends nothing any more.
    ImuDies,
    /// There is no IMU.
    NoImu,
    /// Ranges are 1 % too long.
    RangeScale,
    /// Intensities fall by 6 dB in 100 s.
    Fading,
}

impl Fault {
    /// What is done to the events of a drive.
    pub fn injection(self, seed: u64) -> Injection {
        let mut random = Random::new(seed, STREAM);
        let onset_s = random.between(ONSET_S[0], ONSET_S[1]);
        self.injection_at(onset_s, random)
    }

    /// The same from the drive's begin on.
    pub fn injection_from_start(self, seed: u64) -> Injection {
        self.injection_at(0.0, Random::new(seed, STREAM))
    }

    fn injection_at(self, onset_s: f64, random: Random) -> Injection {
        let always = |change| Injection::new(change, None);
        let lasts = |change, for_s| Injection::new(change, Some([onset_s, onset_s + for_s]));
        let from_then_on = |change| lasts(change, f64::INFINITY);
        match self {
            Self::None | Self::Spins => always(Box::new(|_, _| true)),
            Self::Convoy => lasts(surroundings::convoy(onset_s, 20.0, random), 20.0),
            Self::Interference => lasts(radar::interference(onset_s, 20.0, random), 20.0),
            Self::Kidnapped => lasts(surroundings::kidnapped(onset_s), 0.0),
            Self::Frozen3 => lasts(radar::frozen(onset_s, 3.0), 3.0),
            Self::Frozen10 => lasts(radar::frozen(onset_s, 10.0), 10.0),
            Self::Rain => always(radar::rain(random)),
            Self::Ghosts => always(radar::ghosts(random)),
            Self::People => always(surroundings::people(random)),
            Self::BeamsLost => always(radar::beams_lost(random)),
            Self::Sector => always(radar::sector(random)),
            Self::Jitter => always(radar::jitter(random)),
            Self::Gaps => always(radar::gaps(random)),
            Self::ImuUpsideDown => always(imu::upside_down()),
            Self::YawSign => always(imu::gyro(|rate, _| -rate)),
            Self::RadarMirrored => always(radar::mirrored()),
            Self::GyroDegrees => always(imu::gyro(|rate, _| rate.to_degrees())),
            Self::NoGravity => always(imu::no_gravity()),
            Self::GyroSaturated => always(imu::gyro(|rate, _| rate.clamp(-0.35, 0.35))),
            Self::GyroFrozen => lasts(imu::frozen(onset_s, 20.0), 20.0),
            Self::GyroSpikes => always(imu::spikes()),
            Self::BiasStep => from_then_on(imu::bias(onset_s, |_| 1.0)),
            Self::BiasCreep => from_then_on(imu::bias(onset_s, |for_s| 0.01 * for_s)),
            Self::GyroScale => always(imu::gyro(|rate, _| 1.02 * rate)),
            Self::ClockStep => from_then_on(imu::late(onset_s, 300)),
            Self::ImuLate => always(imu::late(0.0, 50)),
            Self::BiasConstant => always(imu::bias(0.0, |_| 0.5)),
            Self::ImuNoise => always(imu::noise(random)),
            Self::ImuGap => lasts(imu::silent(onset_s, 3.0), 3.0),
            Self::ImuDies => from_then_on(imu::silent(onset_s, f64::INFINITY)),
            Self::NoImu => always(imu::silent(0.0, f64::INFINITY)),
            Self::RangeScale => always(radar::range_scale()),
            Self::Fading => always(radar::fading()),
        }
    }

    /// The robot that drives under it.
    pub fn robot(self, mut robot: Robot) -> Robot {
        if self == Self::Spins {
            let motion = robot.motion.for_calibration();
            robot.motion = randt_simulator::MotionProfile {
                // The driver stays 7 % below its limit.
                yaw_rate_max_rad_s: SPIN_RAD_S / 0.93,
                angular_acceleration_max_rad_s2: 10.0,
                ..motion
            };
        }
        robot
    }

    /// Whether the pipeline has an IMU.
    pub fn has_imu(self) -> bool {
        self != Self::NoImu
    }

    /// Whether its drive is another one, and not the same events changed.
    pub fn has_own_drive(self) -> bool {
        self == Self::Spins
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use clap::ValueEnum;
        let value = self.to_possible_value();
        f.pad(value.as_ref().map_or("", |value| value.get_name()))
    }
}
