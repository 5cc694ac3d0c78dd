use super::{inertial_state::GRAVITY_M_S2, *};

const STEP_NS: i64 = 4_000_000;
const STEP_S: f64 = 0.004;
const SCAN: i64 = 50;
/// Spread of the acceleration of a robot that stands.
const QUIET_M_S2: f64 = 0.035;

/// A robot on a slope whose IMU has biases; the radar sees where it is.
struct Robot {
    filter: InertialSpeed,
    step: i64,
    speed_m_s: f64,
    x_m: f64,
    /// The vertical's x in the robot's frame: a slope that goes down ahead.
    slope: f64,
    rate_bias_rad_s: f64,
}

impl Robot {
    fn new() -> Self {
        Self {
            filter: InertialSpeed::new(&Odometry::default()),
            step: 0,
            speed_m_s: 0.0,
            x_m: 0.0,
            slope: 0.03,
            rate_bias_rad_s: 0.003,
        }
    }

    fn stamp_ns(&self) -> i64 {
        self.step * STEP_NS
    }

    fn gravity(&self) -> Vector3<f64> {
        let up = Vector3::new(self.slope, 0.0, (1.0 - self.slope * self.slope).sqrt());
        up * GRAVITY_M_S2 + Vector3::new(0.02, -0.01, 0.0)
    }

    /// Drives straight on; a scan every fifth of a second.
    fn drive(&mut self, seconds: f64, acceleration_m_s2: f64, is_fixed: bool) {
        for _ in 0..(seconds / STEP_S) as i64 {
            self.step += 1;
            self.x_m += (self.speed_m_s + 0.5 * acceleration_m_s2 * STEP_S) * STEP_S;
            self.speed_m_s += acceleration_m_s2 * STEP_S;
            let force = self.gravity() + Vector3::x() * acceleration_m_s2;
            let rate = Vector3::new(0.0, self.rate_bias_rad_s, 0.0);
            self.filter.push(self.stamp_ns(), rate, force);
            if self.step % SCAN == 0 {
                let level = (1.0 - self.slope * self.slope).sqrt();
                let fix = RadarFix {
                    pose: Pose2::new(5.0, self.x_m * level, std::f64::consts::FRAC_PI_2),
                    sigma_m: [0.02, 0.02],
                };
                let fix = is_fixed.then_some(&fix);
                self.filter.observe_scan(self.stamp_ns(), fix);
            }
        }
    }

    fn stand_still(&self) -> StandstillBias {
        StandstillBias {
            begin_ns: self.stamp_ns() - 1_000_000_000,
            end_ns: self.stamp_ns(),
            bias_rad_s: Vector3::new(0.0, self.rate_bias_rad_s, 0.0),
            sigma_rad_s: Vector3::repeat(1e-4),
            gravity_m_s2: self.gravity(),
            spread_m_s2: QUIET_M_S2,
        }
    }

    /// Two windows of half a second without motion, as a standstill shows them, or a slow and even
    /// drive that shakes by that much; gives whether the last one is believed.
    fn observe_still(&mut self, spread_m_s2: f64) -> bool {
        let mut is_believed = false;
        for _ in 0..2 {
            self.drive(0.6, 0.0, false);
            let still = StandstillBias {
                spread_m_s2,
                ..self.stand_still()
            };
            is_believed = self.filter.observe_still(&still);
        }
        is_believed
    }

    /// How far what it says of the forward speed is off, m/s.
    fn off_m_s(&self) -> f64 {
        self.filter.speed().unwrap().value_m_s[0] - self.speed_m_s
    }
}

#[test]
fn it_proves_true_first_and_then_carries_the_speed_by_the_accelerometer() {
    let mut robot = Robot::new();
    robot.drive(4.0, 0.2, true);
    assert_eq!(robot.filter.speed(), None);
    robot.drive(20.0, 0.0, true);
    let speed = robot.filter.speed().unwrap();
    assert!((speed.value_m_s[0] - 0.8).abs() < 0.02, "{speed:?}");
    assert!(speed.sigma_m_s[0] < 0.05, "{speed:?}");
    // Blind, it brakes and stays slow for ten seconds.
    robot.drive(2.0, -0.2, false);
    robot.drive(8.0, 0.0, false);
    let speed = robot.filter.speed().unwrap();
    let off_m_s = (speed.value_m_s[0] - 0.4).abs();
    assert!(
        off_m_s < 0.1 && off_m_s < 3.0 * speed.sigma_m_s[0],
        "{speed:?}"
    );
    let change = robot.filter.change();
    assert!(change.is_some_and(|change| change.value_m_s[0].abs() < 0.01));
    // What it does not know adds up.
    robot.drive(60.0, 0.0, false);
    assert_eq!(robot.filter.speed(), None);
}

#[test]
fn an_imu_that_does_not_agree_with_the_radar_is_said_and_does_not_carry() {
    let mut robot = Robot::new();
    robot.drive(10.0, 0.2, true);
    robot.drive(10.0, 0.0, true);
    assert!(!robot.filter.disagrees());
    // The radar holds on to what drives along: the robot seems to stand.
    let before_m = robot.x_m;
    for _ in 0..10 {
        robot.drive(0.2, 0.0, true);
        robot.x_m = before_m;
    }
    assert!(robot.filter.disagrees());
    for _ in 0..10 {
        // It measures changes of speed that the radar does not see.
        for acceleration_m_s2 in [1.0, -1.0] {
            let before_m = robot.x_m;
            robot.drive(1.0, acceleration_m_s2, true);
            (robot.x_m, robot.speed_m_s) = (before_m, 0.0);
        }
    }
    assert_eq!(robot.filter.speed(), None);
    assert_eq!(robot.filter.change(), None);
}

#[test]
fn what_is_not_gravity_is_not_taken_out() {
    for shown in [
        Vector3::zeros(),
        Vector3::z(),
        -GRAVITY_M_S2 * Vector3::z(),
        GRAVITY_M_S2 * Vector3::x(),
    ] {
        let mut robot = Robot::new();
        for _ in 0..5000 {
            robot.step += 1;
            robot.filter.push(robot.stamp_ns(), Vector3::zeros(), shown);
            if robot.step % SCAN == 0 {
                robot.filter.observe_scan(robot.stamp_ns(), None);
            }
        }
        assert_eq!(robot.filter.speed(), None);
        // A standstill that shows it ends what was believed.
        let mut robot = Robot::new();
        robot.drive(20.0, 0.0, true);
        let still = StandstillBias {
            gravity_m_s2: shown,
            ..robot.stand_still()
        };
        robot.filter.observe_still(&still);
        assert_eq!(robot.filter.speed(), None);
        assert!(!robot.filter.stands());
    }
}

#[test]
fn a_standstill_is_a_speed_of_zero_unless_the_robot_drives() {
    let mut robot = Robot::new();
    robot.drive(20.0, 0.0, true);
    robot.filter.observe_still(&robot.stand_still());
    assert!(robot.filter.stands());
    robot.filter.observe_motion();
    assert!(!robot.filter.stands());
    // An even speed looks the same to the IMU, but the radar has shown it.
    robot.drive(4.0, 0.2, true);
    robot.drive(2.0, 0.0, true);
    robot.filter.observe_still(&robot.stand_still());
    assert!(!robot.filter.stands());
    let speed = robot.filter.speed().unwrap();
    assert!((speed.value_m_s[0] - 0.8).abs() < 0.05, "{speed:?}");
}

#[test]
fn what_shakes_more_than_a_standstill_is_none_where_the_radar_does_not_see_it() {
    let mut robot = Robot::new();
    robot.drive(20.0, 0.0, true);
    robot.filter.observe_still(&robot.stand_still());
    robot.drive(2.0, 0.18, true);
    // Slowly and evenly on, out of sight, until 0.36 m/s may be 0 for all that the filter knows.
    robot.drive(15.0, 0.0, false);
    // Its rates are no bias of the gyro either.
    assert!(!robot.observe_still(3.0 * QUIET_M_S2));
    assert!(!robot.filter.stands());
    assert!(robot.off_m_s().abs() < 0.15, "{}", robot.off_m_s());
}

#[test]
fn a_standstill_as_quiet_as_before_corrects_a_filter_that_is_sure_and_wrong() {
    let gone_wrong = |drives_quietly: bool| {
        let mut robot = Robot::new();
        robot.drive(20.0, 0.0, true);
        robot.filter.observe_still(&robot.stand_still());
        robot.drive(4.0, 0.2, true);
        if drives_quietly {
            robot.filter.observe_still(&robot.stand_still());
        }
        // It brakes by more than the accelerometer shows.
        robot.drive(2.0, 0.0, false);
        robot.speed_m_s = 0.0;
        assert_eq!(robot.observe_still(QUIET_M_S2), !drives_quietly);
        robot
    };
    let robot = gone_wrong(false);
    assert!(robot.filter.stands());
    assert!(robot.off_m_s().abs() < 0.01, "{}", robot.off_m_s());
    // Where driving is as quiet, it does not tell.
    let robot = gone_wrong(true);
    assert!(!robot.filter.stands());
    assert!(robot.off_m_s() > 0.7, "{}", robot.off_m_s());
}

#[test]
fn what_the_radar_says_over_a_span_is_taken_back_where_the_imu_alone_differs() {
    let mut robot = Robot::new();
    robot.drive(4.0, 0.2, true);
    // Until half a minute of spans is known to be sound.
    robot.drive(60.0, 0.0, true);
    // What drives along pulls by 4 cm a scan, less than one scan shows.
    let mut scans = 0;
    while !robot.filter.disagrees() {
        robot.drive(0.2, 0.0, true);
        robot.x_m -= 0.04;
        scans += 1;
        assert!(scans < 30, "nothing found");
    }
    assert!(robot.off_m_s().abs() < 0.07, "{}", robot.off_m_s());
    // The radar is believed again once both agree.
    robot.drive(4.0, 0.0, true);
    assert!(!robot.filter.disagrees());
    assert!(robot.off_m_s().abs() < 0.03, "{}", robot.off_m_s());
}

#[test]
fn it_survives_its_process() {
    use randt_persist::{Persist, Reader, Writer};
    let mut robot = Robot::new();
    robot.drive(20.0, 0.0, true);
    let mut bytes = [0; 4096];
    robot.filter.save(&mut Writer::new(&mut bytes));
    let mut restored = InertialSpeed::new(&Odometry::default());
    restored.restore(&mut Reader::new(&bytes)).unwrap();
    assert_eq!(restored.speed(), robot.filter.speed());
    robot.drive(1.0, 0.3, false);
    let mut other = Robot {
        filter: restored,
        step: robot.step - 250,
        speed_m_s: 0.0,
        ..Robot::new()
    };
    other.drive(1.0, 0.3, false);
    assert_eq!(other.filter.change(), robot.filter.change());
}
