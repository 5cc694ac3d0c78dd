//! What the accelerometer says of the forward speed, and how far that has proved true.

use nalgebra::Vector3;
use randt_persist::persist;
use std::collections::VecDeque;

/// Span over which the speed's change by radar and by accelerometer are compared, ns: the radar's
/// centimetres a second are then as small as what is looked for.
const SPAN_NS: i64 = 2_000_000_000;
/// Memory of that comparison, s: some changes of speed.
const MEMORY_S: f64 = 10.0;
/// The accelerometer is not used before it was compared for this long, s.
const COMPARED_MIN_S: f64 = 5.0;
/// ... nor where it differs by more, m/s^2: the motion model is as good then.
const SIGMA_MAX_M_S2: f64 = 0.3;
/// No comparison shows less, m/s^2: bias and tilt of a MEMS change by that in a minute.
const SIGMA_MIN_M_S2: f64 = 0.03;
/// Standard gravity, m/s^2, and how far what a standstill shows is off it: scale and bias of a poor
/// accelerometer. One without gravity, or in other units, is further off.
const GRAVITY_M_S2: f64 = 9.806_65;
const LENGTH_TOLERANCE_M_S2: f64 = 1.0;
/// Cosine of the tilt from which a robot does not stand on its wheels, or its IMU is mounted
/// otherwise than it is said.
const UPRIGHT_MIN: f64 = 0.5;
/// How well a still window shows gravity, m/s^2: it may end in a departure.
const GRAVITY_SIGMA_M_S2: f64 = 0.03;
/// How fast the gyro loses it, m/s^2 a second: 0.07 mrad/s, a bias that a standstill has shown.
const GRAVITY_DRIFT_M_S3: f64 = 7e-4;
/// What differs by more standard deviations is an even acceleration.
const GATE_SIGMAS: f64 = 3.0;
/// How long it carries the speed on, ns: what it lacks adds up to half the speed of a robot, and
/// what the grid makes is the smaller error from then on.
const CARRIED_MAX_NS: i64 = 15_000_000_000;
/// Speed above which a window that is still, but felt another gravity, is no standstill, m/s.
const DEPARTED_MAX_M_S: f64 = 0.3;
/// Speed that a robot has not gained while it stands, m/s.
const DEPARTED_M_S: f64 = 0.05;
/// Scans compared from which the speed is known better than from the last one.
const DIFFERENCES_MIN: f64 = 5.0;
/// Scans that are compared at once: more than come in a span.
const SCANS_MAX: usize = 64;

/// A change of the forward speed with its standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedChange {
    /// Change, m/s.
    pub change_m_s: f64,
    /// Its standard deviation, m/s.
    pub sigma_m_s: f64,
}

persist!(SpeedChange {
    change_m_s,
    sigma_m_s
});

/// Integrates the forward acceleration, gravity taken out, and compares it with the radar's speed.
#[derive(Clone, Debug, Default)]
pub struct Accelerometer {
    /// The vertical in the robot's frame, of length one; `None` before a standstill showed it. The
    /// gyro carries it to the next one: gravity would be mistaken for every change of speed.
    up: Option<Vector3<f64>>,
    /// Variance of gravity across it when a standstill last showed it, (m/s^2)^2.
    gravity_variance: f64,
    /// Whether the last window was still, and when the last one was, with the integral then, ns
    /// and m/s.
    stands: bool,
    stood: Option<(i64, f64)>,
    /// The last sample's stamp and forward acceleration, ns and m/s^2.
    last: Option<(i64, f64)>,
    /// The integral, m/s.
    speed_m_s: f64,
    /// Stamps of the scans compared, with the radar's speed less the integral, m/s.
    differences: VecDeque<(i64, f64)>,
    /// When the speed was last known without it, and how much more than the integral it was, ns
    /// and m/s.
    known: Option<(i64, f64)>,
    /// What the accelerometer lacks, mean and variance, m/s^2.
    lack_m_s2: f64,
    variance: f64,
    compared_s: f64,
}

persist!(Accelerometer {
    up,
    gravity_variance,
    stands,
    stood,
    last,
    speed_m_s,
    differences,
    known,
    lack_m_s2,
    variance,
    compared_s,
});

impl Accelerometer {
    /// A window without motion shows gravity, in the robot's frame, m/s^2: the accelerometer's
    /// bias passes for a tilt, which is as good. An even acceleration looks the same, but it is
    /// not where the gyro has carried the vertical.
    pub fn observe_gravity(&mut self, stamp_ns: i64, gravity_m_s2: Vector3<f64>) {
        let length_m_s2 = gravity_m_s2.norm();
        let is_gravity = (length_m_s2 - GRAVITY_M_S2).abs() < LENGTH_TOLERANCE_M_S2
            && gravity_m_s2.z > UPRIGHT_MIN * length_m_s2;
        if !is_gravity {
            // What is taken out would not be gravity: it never proves true.
            *self = Self::default();
            return;
        }
        let drifted = self.stood.map_or(f64::INFINITY, |(then_ns, _)| {
            let drift = GRAVITY_DRIFT_M_S3 * stamp_ns.saturating_sub(then_ns) as f64 * 1e-9;
            self.gravity_variance + drift * drift
        });
        let carried = self.up.unwrap_or_default() * length_m_s2;
        let off = gravity_m_s2 - carried;
        let noise = GRAVITY_SIGMA_M_S2 * GRAVITY_SIGMA_M_S2;
        let sigmas_2 = off.norm_squared() / (drifted + noise);
        let speed_m_s = self.known.map_or(0.0, |(_, d)| self.speed_m_s + d);
        // What is between may be a gentle departure.
        self.stands = sigmas_2 <= 1.0
            || sigmas_2 <= GATE_SIGMAS * GATE_SIGMAS && speed_m_s.abs() < DEPARTED_MAX_M_S;
        if self.stands {
            let gain = 1.0 / (1.0 + noise / drifted);
            self.gravity_variance = gain * noise;
            let fused = carried + off * gain;
            self.up = fused.try_normalize(f64::MIN_POSITIVE).or(self.up);
            self.stood = Some((stamp_ns, self.speed_m_s));
            self.known = Some((stamp_ns, -self.speed_m_s));
            self.lack_m_s2 = 0.0;
        }
    }

    /// The window has motion.
    pub fn observe_motion(&mut self) {
        self.stands = false;
    }

    /// Whether the robot stands: it has not gained speed since a standstill that lasts.
    pub fn stands(&self) -> bool {
        let gained = self
            .stood
            .map(|(_, speed_m_s)| (self.speed_m_s - speed_m_s).abs());
        self.stands && gained.is_some_and(|gained_m_s| gained_m_s < DEPARTED_M_S)
    }

    /// Takes a sample in the robot's frame, the rate without its bias, rad/s and m/s^2; gives the
    /// integral up to it, m/s.
    pub fn push(
        &mut self,
        stamp_ns: i64,
        rate_rad_s: Vector3<f64>,
        acceleration_m_s2: Vector3<f64>,
    ) -> f64 {
        let dt_s = self.last.map_or(0.0, |(last_ns, _)| {
            stamp_ns.saturating_sub(last_ns) as f64 * 1e-9
        });
        let mut forward_m_s2 = 0.0;
        if let Some(up) = &mut self.up {
            // The vertical turns against the robot.
            let turned = *up - rate_rad_s.cross(up) * dt_s;
            *up = turned.try_normalize(f64::MIN_POSITIVE).unwrap_or(*up);
            // Forward in the level: x without its part along the vertical, of length one. Gravity
            // has no part along it.
            let forward = Vector3::x() - *up * up.x;
            let length = forward.norm().max(f64::MIN_POSITIVE);
            forward_m_s2 = acceleration_m_s2.dot(&forward) / length;
        }
        let before_m_s2 = self.last.map_or(forward_m_s2, |(_, last_m_s2)| last_m_s2);
        self.speed_m_s += 0.5 * (before_m_s2 + forward_m_s2) * dt_s;
        self.last = Some((stamp_ns, forward_m_s2));
        self.speed_m_s
    }

    /// Compares the integral at a scan with the speed that the radar shows, m/s.
    pub fn compare(&mut self, stamp_ns: i64, integral_m_s: f64, speed_m_s: f64) {
        let difference_m_s = speed_m_s - integral_m_s;
        let begin_ns = stamp_ns.saturating_sub(SPAN_NS);
        let last_ns = self.differences.back().map(|(stamp_ns, _)| *stamp_ns);
        let mut oldest = None;
        while let Some((first_ns, first_m_s)) = self.differences.front().copied() {
            if first_ns > begin_ns && self.differences.len() < SCANS_MAX {
                break;
            }
            oldest = Some((first_ns, first_m_s));
            self.differences.pop_front();
        }
        let compared = oldest.zip(last_ns).filter(|_| self.up.is_some());
        if let Some(((first_ns, first_m_s), last_ns)) = compared {
            let seconds = |from_ns: i64| stamp_ns.saturating_sub(from_ns) as f64 * 1e-9;
            let lack_m_s2 = (difference_m_s - first_m_s) / seconds(first_ns);
            let dt_s = seconds(last_ns);
            self.compared_s += dt_s;
            let share = dt_s / self.compared_s.min(MEMORY_S);
            let deviation = lack_m_s2 - self.lack_m_s2;
            self.lack_m_s2 += share * deviation;
            self.variance += share * (deviation * deviation - self.variance);
        }
        self.differences.push_back((stamp_ns, difference_m_s));
        self.known = Some((stamp_ns, difference_m_s));
    }

    /// The radar shows no speed for now: the next comparison begins anew.
    pub fn pause(&mut self) {
        self.differences.clear();
    }

    /// The speed at an instant and its standard deviation, m/s, by the integral there and the last
    /// comparisons; `None` where there are too few, or the accelerometer has not proved true.
    pub fn speed(&self, stamp_ns: i64, integral_m_s: f64) -> Option<(f64, f64)> {
        let count = self.differences.len() as f64;
        let sigma_m_s2 = self
            .proved_sigma_m_s2()
            .filter(|_| count >= DIFFERENCES_MIN)?;
        let mean = self.differences.iter().map(|(_, d)| d).sum::<f64>() / count;
        let squares = self
            .differences
            .iter()
            .map(|(_, d)| (d - mean) * (d - mean));
        let variance = squares.sum::<f64>() / (count - 1.0);
        let ages = self
            .differences
            .iter()
            .map(|(then_ns, _)| stamp_ns.saturating_sub(*then_ns));
        let age_s = ages.sum::<i64>() as f64 * 1e-9 / count;
        let drift_m_s = sigma_m_s2 * age_s;
        Some((
            integral_m_s + mean + self.lack_m_s2 * age_s,
            (variance / count + drift_m_s * drift_m_s).sqrt(),
        ))
    }

    /// What the accelerometer differs by, m/s^2, where it has proved true.
    fn proved_sigma_m_s2(&self) -> Option<f64> {
        let sigma_m_s2 = self.variance.sqrt().max(SIGMA_MIN_M_S2);
        (self.compared_s >= COMPARED_MIN_S && sigma_m_s2 <= SIGMA_MAX_M_S2).then_some(sigma_m_s2)
    }

    /// The change of speed over `dt_s` up to an instant, in which the integral changed by
    /// `integral_m_s`; `None` as long as the accelerometer has not proved true, and where the
    /// speed has not been known otherwise for too long.
    ///
    /// What it lacks is the same within a span and independent from one to the next: the speed's
    /// deviation grows with the square root of time.
    pub fn speed_change(&self, stamp_ns: i64, integral_m_s: f64, dt_s: f64) -> Option<SpeedChange> {
        let (known_ns, _) = self.known?;
        if stamp_ns.saturating_sub(known_ns) > CARRIED_MAX_NS {
            return None;
        }
        self.proved_sigma_m_s2().map(|sigma_m_s2| SpeedChange {
            change_m_s: integral_m_s + self.lack_m_s2 * dt_s,
            sigma_m_s: sigma_m_s2 * (SPAN_NS as f64 * 1e-9 * dt_s).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_NS: i64 = 4_000_000;
    const STEP_S: f64 = 0.004;
    const GRAVITY: Vector3<f64> = Vector3::new(0.3, 0.0, 9.8);

    /// Stands for a second on a slope, then accelerates for some seconds; the radar sees both.
    struct Robot {
        accelerometer: Accelerometer,
        stamp_ns: i64,
        speed_m_s: f64,
        integral_m_s: f64,
    }

    impl Robot {
        fn standing() -> Self {
            let mut robot = Self {
                accelerometer: Accelerometer::default(),
                stamp_ns: 0,
                speed_m_s: 0.0,
                integral_m_s: 0.0,
            };
            robot.accelerometer.observe_gravity(0, GRAVITY);
            robot.drive(1.0, 0.0, true);
            robot
        }

        fn drive(&mut self, seconds: f64, acceleration_m_s2: f64, is_seen: bool) {
            for i in 0..(seconds / STEP_S) as usize {
                self.stamp_ns += STEP_NS;
                self.speed_m_s += acceleration_m_s2 * STEP_S;
                let up = GRAVITY.normalize();
                let forward = (Vector3::x() - up * up.x).normalize();
                let force = GRAVITY + forward * acceleration_m_s2;
                self.integral_m_s = self
                    .accelerometer
                    .push(self.stamp_ns, Vector3::zeros(), force);
                if i % 50 == 0 && is_seen {
                    let (stamp_ns, integral_m_s) = (self.stamp_ns, self.integral_m_s);
                    self.accelerometer
                        .compare(stamp_ns, integral_m_s, self.speed_m_s);
                }
            }
        }
    }

    #[test]
    fn it_proves_true_first_and_then_carries_the_speed() {
        let mut robot = Robot::standing();
        robot.drive(1.0, 0.5, true);
        assert_eq!(
            robot.accelerometer.speed_change(robot.stamp_ns, 0.0, 0.2),
            None
        );
        robot.drive(10.0, 0.0, true);
        let (speed_m_s, sigma_m_s) = robot
            .accelerometer
            .speed(robot.stamp_ns, robot.integral_m_s)
            .unwrap();
        assert!(
            (speed_m_s - 0.5).abs() < 0.02 && sigma_m_s < 0.1,
            "{speed_m_s}"
        );
        let before_m_s = robot.integral_m_s;
        robot.drive(0.2, -0.5, false);
        let integral_m_s = robot.integral_m_s - before_m_s;
        let change = robot
            .accelerometer
            .speed_change(robot.stamp_ns, integral_m_s, 0.2)
            .unwrap();
        assert!((change.change_m_s + 0.1).abs() < 0.01, "{change:?}");
        assert!((0.01..0.05).contains(&change.sigma_m_s), "{change:?}");
        // What it lacks adds up.
        robot.drive(15.0, 0.0, false);
        assert_eq!(
            robot.accelerometer.speed_change(robot.stamp_ns, 0.0, 0.2),
            None
        );
    }

    #[test]
    fn an_accelerometer_that_is_wrong_is_not_used() {
        let mut robot = Robot::standing();
        for _ in 0..10 {
            // The radar sees no change where it measures half a m/s^2, then the other way.
            for acceleration_m_s2 in [0.5, -0.5] {
                robot.drive(2.4, acceleration_m_s2, true);
                robot.speed_m_s = 0.0;
            }
        }
        assert_eq!(
            robot.accelerometer.speed_change(robot.stamp_ns, 0.0, 0.2),
            None
        );
    }

    #[test]
    fn what_is_not_gravity_is_not_taken_out() {
        let no_gravity = GRAVITY - GRAVITY * 0.99;
        for shown in [no_gravity, GRAVITY / 9.8, -GRAVITY, Vector3::x() * 9.8] {
            let mut robot = Robot::standing();
            robot.drive(10.0, 0.0, true);
            let carries = |robot: &Robot| {
                let change = robot.accelerometer.speed_change(robot.stamp_ns, 0.0, 0.2);
                change.is_some()
            };
            assert!(carries(&robot));
            robot.accelerometer.observe_gravity(robot.stamp_ns, shown);
            assert!(
                !carries(&robot) && !robot.accelerometer.stands(),
                "{shown:?}"
            );
        }
    }

    #[test]
    fn an_even_acceleration_is_no_standstill() {
        let mut robot = Robot::standing();
        assert!(robot.accelerometer.stands());
        robot.drive(1.0, 0.4, true);
        assert!(!robot.accelerometer.stands(), "it has gained speed");
        let felt = GRAVITY + Vector3::x() * 0.4;
        robot.accelerometer.observe_gravity(robot.stamp_ns, felt);
        assert!(!robot.accelerometer.stands());
        robot.drive(1.0, -0.4, true);
        robot.accelerometer.observe_gravity(robot.stamp_ns, GRAVITY);
        assert!(robot.accelerometer.stands());
        robot.accelerometer.observe_motion();
        assert!(!robot.accelerometer.stands());
    }
}
