//! The speed that the IMU carries, over holes and clocks that are set back.

use super::*;
use randt_config::Config;
use randt_geometry::Pose2;

const STEP_NS: i64 = 4_000_000;

/// A robot that stands for twenty seconds, in which the IMU proves true.
fn standing() -> GyroIntegrator {
    let config = Config::default();
    let mut gyro = GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry);
    for i in 0..5000 {
        push(&mut gyro, i * STEP_NS);
        if i % 50 == 49 {
            gyro.observe_scan(i * STEP_NS, Some(&fix()));
        }
    }
    gyro
}

fn fix() -> RadarFix {
    RadarFix {
        pose: Pose2::IDENTITY,
        sigma_m: [0.02, 0.02],
    }
}

fn push(gyro: &mut GyroIntegrator, stamp_ns: i64) {
    let mut sample = ImuSample::default();
    sample.header.stamp_ns = stamp_ns;
    sample.acceleration_m_s2 = [0.0, 0.0, 9.81];
    gyro.push(&sample);
}

#[test]
fn after_a_hole_or_a_clock_that_was_set_back_the_imu_proves_true_anew() {
    let end_ns = 4999 * STEP_NS;
    let carries = |gyro: &GyroIntegrator| {
        let speed = gyro.inertial_speed();
        (speed.change().is_some(), speed.stands())
    };
    let mut gyro = standing();
    assert_eq!(carries(&gyro), (true, true));
    // A sample that lacks is no hole.
    push(&mut gyro, end_ns + 2 * STEP_NS);
    assert_eq!(carries(&gyro), (true, true));
    push(&mut gyro, end_ns + 2 * STEP_NS + HOLE_NS + 1);
    assert_eq!((carries(&gyro), gyro.holes), ((false, false), 1));

    let mut gyro = standing();
    let back_ns = end_ns - 3_600_000_000_000;
    push(&mut gyro, back_ns);
    push(&mut gyro, back_ns + STEP_NS);
    assert_eq!(carries(&gyro), (false, false));
}

/// A vehicle stands, gathers speed for six seconds, then drives round a bend, on level ground.
#[test]
fn what_accelerates_the_robot_is_no_slope() {
    let config = Config::default();
    let mut gyro = GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry);
    let (rise_m_s2, radius_m) = (1.0, 20.0);
    let mut worst = 0.0_f64;
    let (mut pose, mut speed_m_s) = (Pose2::default(), 0.0);
    for step in 0..3500_i64 {
        let rate_rad_s = if step < 2000 {
            0.0
        } else {
            speed_m_s / radius_m
        };
        let gathers = (500..2000).contains(&step);
        let rise_m_s2 = if gathers { rise_m_s2 } else { 0.0 };
        let mut sample = ImuSample::default();
        sample.header.stamp_ns = step * STEP_NS;
        sample.rate_rad_s = [0.0, 0.0, rate_rad_s];
        sample.acceleration_m_s2 = [rise_m_s2, speed_m_s * rate_rad_s, 9.806_65];
        gyro.push(&sample);
        if step % 50 == 0 {
            let fix = RadarFix {
                pose,
                sigma_m: [0.02; 2],
            };
            gyro.observe_scan(step * STEP_NS, Some(&fix));
        }
        speed_m_s += rise_m_s2 * 0.004;
        pose = pose.compose(&Pose2::exp(
            Vector3::new(speed_m_s, 0.0, rate_rad_s) * 0.004,
        ));
        let (roll, pitch, _) = gyro.attitude().roll_pitch_yaw();
        worst = worst.max(roll.abs()).max(pitch.abs());
    }
    // By the accelerometer alone 5.4 and 9 degrees.
    assert!(worst < 0.02, "{worst} rad");
}
