//! A MEMS IMU on a driving robot: noise, drifting bias, gravity, vibration, its own clock.

use crate::{MotionState, Random, RobotAttitude};
use randt_geometry::elementary::{PI, sin};
use randt_messages::{Header, ImuSample};

/// What an IMU is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuProfile {
    /// Time between samples.
    pub period_ns: i64,
    /// The first sample's instant; no multiple of a scan's, so that samples and scans never fall
    /// together.
    pub offset_ns: i64,
    /// Largest deviation of a sample's instant from the even grid, either way.
    pub jitter_ns: i64,
    /// Largest error of a stamp against the sample's instant, either way.
    pub stamp_error_ns: i64,
    /// Noise of a rate, one standard deviation.
    pub rate_noise_rad_s: f64,
    /// Bias of a rate at the start, one standard deviation.
    pub rate_bias_rad_s: f64,
    /// Random walk of the bias, rad/s per square root of s.
    pub rate_bias_walk: f64,
    /// Noise of an acceleration, one standard deviation.
    pub acceleration_noise_m_s2: f64,
    /// Bias of an acceleration, one standard deviation.
    pub acceleration_bias_m_s2: f64,
    /// Vibration of the driving robot at 1 m/s, amplitude.
    pub vibration_m_s2: f64,
    /// The same on the rates.
    pub vibration_rad_s: f64,
}

impl Default for ImuProfile {
    /// A Phidgets Spatial at 250 Hz, with the noise of the recording room.bag.
    fn default() -> Self {
        Self {
            period_ns: 4_000_000,
            offset_ns: 1_700_000,
            jitter_ns: 300_000,
            stamp_error_ns: 100_000,
            rate_noise_rad_s: 0.003,
            rate_bias_rad_s: 0.005,
            rate_bias_walk: 5e-5,
            acceleration_noise_m_s2: 0.02,
            acceleration_bias_m_s2: 0.03,
            vibration_m_s2: 0.25,
            vibration_rad_s: 0.004,
        }
    }
}

/// The IMU.
#[derive(Clone, Debug)]
pub(crate) struct Imu {
    profile: ImuProfile,
    random: Random,
    rate_bias: [f64; 3],
    acceleration_bias: [f64; 3],
    sequence: u64,
    next_ns: i64,
}

impl Imu {
    pub fn new(profile: ImuProfile, seed: u64) -> Self {
        let mut random = Random::new(seed, 2);
        let rate_bias = [(); 3].map(|()| profile.rate_bias_rad_s * random.normal());
        let acceleration_bias = [(); 3].map(|()| profile.acceleration_bias_m_s2 * random.normal());
        let next_ns = profile.offset_ns;
        Self {
            profile,
            random,
            rate_bias,
            acceleration_bias,
            sequence: 0,
            next_ns,
        }
    }

    /// The instant of the next sample.
    pub fn next_ns(&self) -> i64 {
        self.next_ns
    }

    /// The sample of [`Imu::next_ns`]; `state` and `attitude` are the robot's then. Stamps count
    /// from the start.
    pub fn sample(&mut self, state: &MotionState, attitude: &RobotAttitude) -> ImuSample {
        let profile = self.profile;
        let time_s = self.next_ns as f64 * 1e-9;
        let walk = profile.rate_bias_walk * (profile.period_ns as f64 * 1e-9).sqrt();
        // Wheels and floor: lines that do not fit each other, growing with speed.
        let shaking =
            |hertz: f64, phase: f64| state.velocity[0] * sin(2.0 * PI * hertz * time_s + phase);
        let rate_lines = [
            shaking(17.3, 0.0),
            shaking(23.9, 1.0),
            0.3 * shaking(19.1, 2.0),
        ];
        let acceleration_lines = [shaking(31.7, 0.5), shaking(27.1, 1.5), shaking(36.5, 2.5)];
        let mut rate_rad_s = [0.0; 3];
        let mut acceleration_m_s2 = [0.0; 3];
        for axis in 0..3 {
            let (a, b) = self.random.normal_pair();
            self.rate_bias[axis] += walk * self.random.normal();
            rate_rad_s[axis] = attitude.rate_rad_s[axis]
                + self.rate_bias[axis]
                + profile.rate_noise_rad_s * a
                + profile.vibration_rad_s * rate_lines[axis];
            acceleration_m_s2[axis] = attitude.force_m_s2[axis]
                + self.acceleration_bias[axis]
                + profile.acceleration_noise_m_s2 * b
                + profile.vibration_m_s2 * acceleration_lines[axis];
        }
        let error =
            |random: &mut Random, size: i64| (random.between(-1.0, 1.0) * size as f64) as i64;
        let stamp_ns = self.next_ns + error(&mut self.random, profile.stamp_error_ns);
        let sample = ImuSample {
            header: Header {
                sequence: self.sequence,
                stamp_ns,
                ..Header::default()
            },
            device_ns: self.next_ns - profile.offset_ns,
            // USB brings samples late by a millisecond or so.
            arrival_ns: stamp_ns + 1_000_000 + (500_000.0 * self.random.exponential()) as i64,
            rate_rad_s,
            acceleration_m_s2,
        };
        self.sequence += 1;
        let grid_ns = profile.offset_ns + self.sequence as i64 * profile.period_ns;
        self.next_ns = grid_ns + error(&mut self.random, profile.jitter_ns);
        sample
    }
}
