//! The speed that the IMU carries, over holes and clocks that are set back.

use super::*;
use randt_config::Config;

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
        pose: randt_geometry::Pose2::IDENTITY,
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
