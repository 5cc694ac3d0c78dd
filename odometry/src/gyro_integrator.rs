//! The gyro's heading as a function of time, from IMU samples as they come.

mod instants;
mod own_acceleration;

use crate::{
    gravity_check::GravityCheck,
    gyro_rates::GyroRates,
    inertial_speed::{InertialSpeed, RadarFix, Speed},
    stamps::{STAMPS_NS, is_set_back},
    tilt::Tilt,
};
use nalgebra::Vector3;
use own_acceleration::OwnAcceleration;
use randt_config::{Attitude, Odometry, Robot};
use randt_filter::{AttitudeFilter, GyroBias, Standstill};
use randt_geometry::Quaternion;
use randt_messages::ImuSample;
use randt_persist::persist;
use std::collections::VecDeque;

/// Samples kept: two seconds at 1 kHz, more than the longest sweep and its wait.
const CAPACITY: usize = 2048;
/// A hole in the samples above this is not bridged by a straight line, ns (0.1 s).
const HOLE_NS: i64 = 100_000_000;

/// An IMU without a sample for this long before a scan's end carries no speed to it, ns: as long
/// as a hole.
const SILENT_NS: i64 = HOLE_NS;

/// Stamps that are later are of another clock, ns.
const LATE_MAX_NS: i64 = 1_000_000_000;

/// What is integrated up to one sample.
#[derive(Clone, Copy, Debug, Default)]
struct GyroState {
    stamp_ns: i64,
    /// Integrated rate of the heading, bias and all, rad.
    heading_rad: f64,
    rate_rad_s: f64,
    tilt: Tilt,
}

/// Which sample was integrated last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NewestSample {
    /// Its number.
    pub sequence: u64,
    /// Its publisher's start.
    pub epoch: u64,
    /// When it was published.
    pub published_ns: i64,
}

/// How the heading turned over a span of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turn {
    /// Bias and all, rad.
    pub angle_rad: f64,
    /// Time within the span that no sample covers, s.
    pub uncovered_s: f64,
}

/// What the gyro measured between two scans.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GyroTerm {
    /// Turn of the heading, bias and all.
    pub turn: Turn,
    /// Yaw rate at the newer scan, bias and all, rad/s.
    pub rate_rad_s: f64,
    /// Bias that a standstill showed since the scan before, and its standard deviation, rad/s.
    pub standstill: Option<(f64, f64)>,
    /// Change of the forward speed, where the IMU carries it.
    pub speed_change: Option<Speed>,
    /// The forward speed itself.
    pub speed: Option<Speed>,
    /// Whether the robot stands.
    pub stands: bool,
}

/// Integrates the gyro's yaw rate, tilt taken out; steps the attitude filter. It owns the gyro's
/// bias: the attitude filter gets rates without it. Its fields are what one sample changes, turned
/// into the robot's frame and checked once.
#[derive(Debug)]
pub struct GyroIntegrator {
    base_from_imu: Quaternion,
    bias_walk: f64,
    attitude: AttitudeFilter,
    own_acceleration: OwnAcceleration,
    inertial_speed: InertialSpeed,
    standstill: Standstill,
    gravity: GravityCheck,
    rates: GyroRates,
    states: VecDeque<GyroState>,
    newest: Option<NewestSample>,
    /// Of all three axes, from standstills; the window estimates that of the yaw better.
    bias: GyroBias,
    yaw_bias_rad_s: f64,
    yaw_bias_variance: f64,
    /// The last yaw bias that a standstill showed, with its standard deviation, until it is taken,
    /// rad/s.
    standstill_bias: Option<(f64, f64)>,
    /// How late its stamps are, as they were found to be, ns.
    late_ns: i64,
    /// Samples that went back in time, repeated a stamp or held no numbers.
    pub rejected: u64,
    /// Holes in the samples above 0.1 s.
    pub holes: u64,
}

persist!(GyroState {
    stamp_ns,
    heading_rad,
    rate_rad_s,
    tilt
});
persist!(NewestSample {
    sequence,
    epoch,
    published_ns
});
persist!(Turn {
    angle_rad,
    uncovered_s
});
persist!(GyroTerm {
    turn,
    rate_rad_s,
    standstill,
    speed_change,
    speed,
    stands
});
persist!(GyroIntegrator {
    attitude,
    own_acceleration,
    inertial_speed,
    standstill,
    gravity,
    rates,
    states,
    newest,
    bias,
    yaw_bias_rad_s,
    yaw_bias_variance,
    standstill_bias,
    late_ns,
    rejected,
    holes,
} kept {
    base_from_imu,
    bias_walk,
} sound is_sound);

impl GyroIntegrator {
    /// Nothing known yet.
    pub fn new(attitude: &Attitude, robot: &Robot, odometry: &Odometry) -> Self {
        Self {
            base_from_imu: Quaternion::from_roll_pitch_yaw(
                robot.imu_roll_rad,
                robot.imu_pitch_rad,
                robot.imu_yaw_rad,
            ),
            attitude: AttitudeFilter::new(attitude),
            own_acceleration: OwnAcceleration::default(),
            inertial_speed: InertialSpeed::new(odometry),
            standstill: Standstill::new(attitude),
            gravity: GravityCheck::default(),
            rates: GyroRates::default(),
            states: VecDeque::with_capacity(CAPACITY),
            newest: None,
            bias: GyroBias::new(odometry.gyro_bias_sigma_rad_s, odometry.gyro_bias_walk),
            yaw_bias_rad_s: 0.0,
            yaw_bias_variance: odometry.gyro_bias_sigma_rad_s * odometry.gyro_bias_sigma_rad_s,
            bias_walk: odometry.gyro_bias_walk,
            standstill_bias: None,
            late_ns: 0,
            rejected: 0,
            holes: 0,
        }
    }

    /// Starts from what was known before: bias and heading.
    pub fn start_from(&mut self, bias_rad_s: Vector3<f64>, attitude: Quaternion) {
        self.bias.start_from(bias_rad_s);
        self.yaw_bias_rad_s = bias_rad_s.z;
        self.attitude.start_from(attitude);
    }

    /// Whether the states are in order, of stamps that leave room for sums, and the counters have
    /// room.
    fn is_sound(&self) -> bool {
        let stamps = self.states.iter().map(|m| m.stamp_ns);
        stamps.clone().all(|t| STAMPS_NS.contains(&t))
            && stamps.is_sorted_by(|a, b| a < b)
            && self.states.len() <= CAPACITY
            && self.late_ns.abs() <= LATE_MAX_NS
            && self.rejected.max(self.holes) <= u64::MAX / 2
    }

    /// Integrates a sample; the yaw bias that a standstill shows is kept for
    /// [`Self::take_standstill_bias`].
    pub fn push(&mut self, sample: &ImuSample) {
        let stamp_ns = sample.header.stamp_ns;
        let mut rate = self.base_from_imu.rotate(Vector3::from(sample.rate_rad_s));
        let acceleration = self
            .base_from_imu
            .rotate(Vector3::from(sample.acceleration_m_s2));
        let finite = rate.iter().chain(&acceleration).all(|v| v.is_finite());
        let last = self.states.back().copied();
        let last = match last {
            // The clock was set back: what was integrated belongs to another time.
            Some(last) if is_set_back(stamp_ns, last.stamp_ns) => {
                self.states.clear();
                None
            }
            last => last,
        };
        if !finite || last.is_some_and(|last| stamp_ns <= last.stamp_ns) {
            self.rejected += 1;
            return;
        }
        let shows_gravity = self.gravity.push(stamp_ns, acceleration);
        rate.z = self.rates.push(stamp_ns, rate.z);
        self.newest = Some(NewestSample {
            sequence: sample.header.sequence,
            epoch: sample.header.epoch,
            published_ns: sample.header.published_ns,
        });
        if last.is_none_or(|last| stamp_ns - last.stamp_ns > HOLE_NS) {
            // Speed and vertical are those of another time, or were not followed in the hole.
            self.inertial_speed.restart();
        }
        if let Some(last) = last {
            let dt_s = (stamp_ns - last.stamp_ns) as f64 * 1e-9;
            self.bias.advance(dt_s);
            self.yaw_bias_variance += self.bias_walk * self.bias_walk * dt_s;
        }
        let still = self.standstill.push(stamp_ns, rate, acceleration);
        let shown = still.filter(|still| self.inertial_speed.observe_still(still));
        if let Some(still) = &shown {
            self.bias.observe(still);
        } else if self.standstill.still_since_ns().is_none() {
            self.inertial_speed.observe_motion();
        }
        let bias = self.bias_rad_s();
        self.standstill.expect_bias(bias, self.bias.sigma_rad_s());
        let gravity = acceleration - self.own_acceleration.at(rate.z - bias.z);
        self.attitude.push(stamp_ns, rate - bias, gravity);
        let without_yaw_bias = rate - Vector3::new(0.0, 0.0, bias.z);
        self.inertial_speed
            .push(stamp_ns, without_yaw_bias, acceleration);
        let tilt = match shows_gravity {
            true => Tilt::from_up(self.attitude.up_in_body()),
            false => Tilt::LEVEL,
        };
        // The heading's own bias stays in: it is estimated with the window.
        let rate_rad_s = tilt.yaw_rate_rad_s(rate - Vector3::new(bias.x, bias.y, 0.0));
        let heading_rad = last.map_or(0.0, |last| {
            let dt_ns = stamp_ns - last.stamp_ns;
            if dt_ns > HOLE_NS {
                self.holes += 1;
            }
            last.heading_rad + 0.5 * (last.rate_rad_s + rate_rad_s) * dt_ns as f64 * 1e-9
        });
        if self.states.len() == CAPACITY {
            self.states.pop_front();
        }
        self.states.push_back(GyroState {
            stamp_ns,
            heading_rad,
            rate_rad_s,
            tilt,
        });
        if let Some(still) = shown {
            self.standstill_bias = Some((still.bias_rad_s.z, still.sigma_rad_s.z));
        }
    }

    /// The yaw bias that the last standstill showed, with its standard deviation, rad/s; once.
    pub fn take_standstill_bias(&mut self) -> Option<(f64, f64)> {
        self.standstill_bias.take()
    }

    /// What the accelerometer shows of gravity.
    pub fn gravity(&self) -> &GravityCheck {
        &self.gravity
    }

    /// What the rates show sample by sample.
    pub fn rates(&self) -> &GyroRates {
        &self.rates
    }

    /// Stamp of the newest sample, as it came.
    pub fn newest_ns(&self) -> Option<i64> {
        self.states.back().map(|m| m.stamp_ns)
    }

    /// Which sample is the newest.
    pub fn newest(&self) -> Option<&NewestSample> {
        self.newest.as_ref()
    }

    /// The speed that was carried so far is not to be believed.
    pub fn restart_inertial_speed(&mut self) {
        self.inertial_speed.restart();
    }

    /// The speed as IMU and radar know it.
    pub fn inertial_speed(&self) -> &InertialSpeed {
        &self.inertial_speed
    }

    /// Wheels that are believed show the speed, forward and to the left, m/s.
    pub fn observe_wheels(&mut self, speed_m_s: [f64; 2]) {
        self.inertial_speed.observe_wheels(speed_m_s);
    }

    /// A scan was estimated: where the radar has it, if it does.
    pub fn observe_scan(&mut self, stamp_ns: i64, fix: Option<&RadarFix>) {
        let own_ns = self.own_ns(stamp_ns);
        let is_silent = |newest_ns| own_ns.saturating_sub(newest_ns) > SILENT_NS;
        if self.newest_ns().is_some_and(is_silent) {
            // An IMU that says nothing does not contradict the radar.
            self.inertial_speed.restart();
        }
        self.inertial_speed.observe_scan(stamp_ns, fix);
        let carried = self.inertial_speed.speed().map(|speed| speed.value_m_s);
        self.own_acceleration.observe_scan(stamp_ns, fix, carried);
    }

    /// Attitude of `base_link`.
    pub fn attitude(&self) -> Quaternion {
        self.attitude.attitude()
    }

    /// Gyro bias in `base_link`, rad/s: standstills give x and y, the window z.
    pub fn bias_rad_s(&self) -> Vector3<f64> {
        let bias = self.bias.mean_rad_s();
        Vector3::new(bias.x, bias.y, self.yaw_bias_rad_s)
    }

    /// Takes over the yaw bias that the window has estimated, with its variance.
    pub fn set_yaw_bias(&mut self, bias_rad_s: f64, variance: f64) {
        (self.yaw_bias_rad_s, self.yaw_bias_variance) = (bias_rad_s, variance);
    }

    /// Standard deviation of the yaw bias, rad/s.
    pub fn yaw_bias_sigma_rad_s(&self) -> f64 {
        self.yaw_bias_variance.sqrt()
    }
}

#[cfg(test)]
mod tests;
