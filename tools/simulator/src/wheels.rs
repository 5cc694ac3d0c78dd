//! Wheel odometry on a driving robot: what its wheels turn, which is not what it moves.

use crate::{MotionState, Random};
use randt_geometry::elementary::sin;
use randt_messages::{Header, Twist};
use std::str::FromStr;

/// Yaw rate above which wheels slip, rad/s.
const SLIP_RATE_RAD_S: f64 = 0.2;
/// Track of a robot indoors, m: by it the sides' noise makes that of the yaw rate.
const TRACK_M: f64 = 0.5;
/// How fast and how hard the wheels spin on ice at most, beside the robot's own speed, m/s and
/// m/s^2.
const SPIN_M_S: f64 = 1.0;
const SPIN_M_S2: f64 = 2.0;
/// Seconds of a second, ns.
const SECOND_NS: i64 = 1_000_000_000;

/// What is wrong with wheels as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WheelFault {
    /// Nothing.
    #[default]
    None,
    /// They never turn.
    Stuck,
    /// They count backwards.
    Reversed,
    /// They spin.
    Spinning,
}

/// What wheel odometry is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelProfile {
    /// Time between measurements.
    pub period_ns: i64,
    /// The first one's instant; no multiple of a scan's or of the IMU's.
    pub offset_ns: i64,
    /// Speed of the wheels by that of the robot.
    pub scale: f64,
    /// How much more of it they turn where the robot turns.
    pub slip: f64,
    /// Noise of a speed, one standard deviation.
    pub noise_m_s: f64,
    /// What is wrong, and from when on, s.
    pub fault: WheelFault,
    /// See there.
    pub fault_from_s: f64,
}

impl Default for WheelProfile {
    /// Encoders read at 50 Hz.
    fn default() -> Self {
        Self {
            period_ns: 20_000_000,
            offset_ns: 7_300_000,
            scale: 1.0,
            slip: 0.0,
            noise_m_s: 0.01,
            fault: WheelFault::None,
            fault_from_s: 0.0,
        }
    }
}

impl FromStr for WheelProfile {
    type Err = String;

    /// As `scale=1.02,slip=0.05,fault=stuck,from=30`; what is not given is without error.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut profile = Self::default();
        for part in text.split(',') {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let number = |low: f64, high: f64| {
                let number = value.parse().ok().filter(|n| (low..=high).contains(n));
                number.ok_or_else(|| format!("expected {key}= with a number from {low} to {high}"))
            };
            match key {
                "scale" => profile.scale = number(0.1, 10.0)?,
                "slip" => profile.slip = number(-1.0, 1.0)?,
                "noise" => profile.noise_m_s = number(0.0, 1.0)?,
                "from" => profile.fault_from_s = number(0.0, 1e6)?,
                "fault" => {
                    profile.fault = match value {
                        "none" => WheelFault::None,
                        "stuck" => WheelFault::Stuck,
                        "reversed" => WheelFault::Reversed,
                        "spinning" => WheelFault::Spinning,
                        _ => return Err("expected fault=stuck, reversed or spinning".to_owned()),
                    }
                }
                _ => return Err("expected scale=, slip=, noise=, fault= and from=".to_owned()),
            }
        }
        Ok(profile)
    }
}

/// The wheels.
#[derive(Clone, Debug)]
pub(crate) struct Wheels {
    profile: WheelProfile,
    random: Random,
    sequence: u64,
}

impl Wheels {
    pub fn new(profile: WheelProfile, seed: u64) -> Self {
        Self {
            profile,
            random: Random::new(seed, 4),
            sequence: 0,
        }
    }

    /// The instant of the next measurement.
    pub fn next_ns(&self) -> i64 {
        self.profile.offset_ns + self.sequence as i64 * self.profile.period_ns
    }

    /// The measurement of [`Wheels::next_ns`]; `state` is the robot's then. Stamps count from the
    /// start.
    pub fn measure(&mut self, state: &MotionState) -> Twist {
        let (profile, stamp_ns) = (self.profile, self.next_ns());
        let [forward, _, yaw_rate] = state.velocity;
        let slip = match yaw_rate.abs() > SLIP_RATE_RAD_S {
            true => 1.0 + profile.slip,
            false => 1.0,
        };
        let since_s = stamp_ns as f64 / SECOND_NS as f64 - profile.fault_from_s;
        let turned_m_s = forward * profile.scale * slip;
        let wheels_m_s = match profile.fault {
            WheelFault::Stuck if since_s >= 0.0 => 0.0,
            WheelFault::Reversed if since_s >= 0.0 => -turned_m_s,
            WheelFault::Spinning if since_s >= 0.0 => {
                // They grip now and then.
                let spin_m_s = (SPIN_M_S2 * since_s).min(SPIN_M_S);
                turned_m_s + spin_m_s * (1.0 + 0.3 * sin(since_s))
            }
            _ => turned_m_s,
        };
        let noise = |random: &mut Random| profile.noise_m_s * random.normal();
        let is_stuck = profile.fault == WheelFault::Stuck && since_s >= 0.0;
        let (mut speed, mut rate) = (wheels_m_s, yaw_rate * slip);
        let drawn = [noise(&mut self.random), noise(&mut self.random)];
        if is_stuck {
            rate = 0.0;
        } else if forward.abs() > 0.0 || yaw_rate.abs() > 0.0 || speed.abs() > 0.0 {
            // Standing wheels count nothing.
            speed += drawn[0];
            rate += 2.0 * drawn[1] / TRACK_M;
        }
        let variance = profile.noise_m_s * profile.noise_m_s;
        let mut covariance = [0.0; 9];
        (covariance[0], covariance[4]) = (variance, variance);
        covariance[8] = 4.0 * variance / (TRACK_M * TRACK_M);
        let twist = Twist {
            header: Header {
                sequence: self.sequence,
                stamp_ns,
                ..Header::default()
            },
            arrival_ns: stamp_ns + 1_000_000,
            velocity: [speed, 0.0, rate],
            covariance,
        };
        self.sequence += 1;
        twist
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_says_what_wheels_are_like() {
        let wheels: WheelProfile = "scale=1.02,slip=0.05".parse().unwrap();
        assert_eq!((wheels.scale, wheels.slip), (1.02, 0.05));
        let stuck: WheelProfile = "fault=stuck,from=30".parse().unwrap();
        assert_eq!((stuck.fault, stuck.fault_from_s), (WheelFault::Stuck, 30.0));
        for wrong in ["", "scale", "scale=a", "scale=100", "fault=flat", "size=2"] {
            assert!(wrong.parse::<WheelProfile>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn wheels_turn_more_where_they_slip_and_spin_though_the_robot_stands() {
        let measure = |text: &str, velocity: [f64; 3]| {
            let profile = format!("noise=0,{text}").parse().unwrap();
            let state = MotionState {
                pose: [0.0; 3],
                velocity,
                acceleration: [0.0; 3],
                path_m: 0.0,
            };
            let mut wheels = Wheels::new(profile, 1);
            (0..100).map(|_| wheels.measure(&state)).last().unwrap()
        };
        let [straight, turning] = [0.1, 0.3].map(|rate| {
            let twist = measure("scale=1.02,slip=0.05", [1.0, 0.0, rate]);
            twist.velocity[0]
        });
        assert!((straight - 1.02).abs() < 1e-12 && (turning - 1.071).abs() < 1e-12);
        assert_eq!(measure("fault=stuck", [1.0, 0.0, 0.3]).velocity, [0.0; 3]);
        assert_eq!(measure("fault=reversed", [1.0, 0.0, 0.0]).velocity[0], -1.0);
        assert!(measure("fault=spinning", [0.0; 3]).velocity[0] > 0.6);
    }
}
