//! Wheels that say the truth, more than that, or something else.

use super::*;

const DT_S: f64 = 0.2;
/// Steps until a way counts as fixed.
const WARM_UP: usize = 16;

fn measured(forward_m: f64) -> MeasuredWay {
    MeasuredWay {
        way_m: [forward_m, 0.0],
        turn_rad: 0.0,
        dt_s: DT_S,
        sigma_m_s: [0.01; 2],
    }
}

/// Drives along a fixed way at 0.8 m/s, a step of 0.2 s at a time, `steps` after those in which it
/// becomes fixed; wheels turn by `wheels` of a step, and `turn_rad` is turned. Gives the last lie.
fn drive(
    monitor: &mut TwistMonitor,
    steps: usize,
    turn_rad: f64,
    wheels: impl Fn(f64) -> f64,
) -> Option<Lie> {
    monitor.restart();
    let mut pose = Pose2::IDENTITY;
    let mut lie = None;
    for step in 0..WARM_UP + steps {
        pose = pose.compose(&Pose2::new(0.16, 0.0, 0.0));
        // Fixes err by 2 cm to and fro.
        let error_m = if step % 2 == 0 { 0.02 } else { -0.02 };
        let fix = Pose2::new(pose.x_m + error_m, pose.y_m, pose.yaw_rad);
        let measured = (measured(wheels(0.16)), turn_rad);
        lie = monitor.observe_scan(Some(&measured), Some(fix)).or(lie);
    }
    lie
}

#[test]
fn scale_and_slip_are_estimated() {
    let mut monitor = TwistMonitor::new();
    assert_eq!(monitor.way(&measured(0.16), 0.0), None);
    assert_eq!(drive(&mut monitor, 200, 0.0, |way_m| 1.02 * way_m), None);
    assert_eq!(
        drive(&mut monitor, 200, 0.08, |way_m| 1.02 * 1.05 * way_m),
        None
    );
    let straight = monitor.way(&measured(1.02), 0.0).unwrap();
    assert!((straight.way_m[0] - 1.0).abs() < 0.004, "{straight:?}");
    let curve = monitor.way(&measured(1.02 * 1.05), 0.08).unwrap();
    assert!((curve.way_m[0] - 1.0).abs() < 0.004, "{curve:?}");
    // What is not known of the scale is in the way's noise.
    let unknown = TwistMonitor {
        proofs: 1,
        ..TwistMonitor::new()
    };
    let unknown = unknown.way(&measured(1.0), 0.0).unwrap();
    assert!(unknown.sigma_m[0] > 2.0 * straight.sigma_m[0]);
}

#[test]
fn wheels_that_lie_are_refused_until_they_are_proved_again() {
    let lies: [fn(f64) -> f64; 3] = [|_| 0.0, |way_m| -way_m, |way_m| way_m + 0.2];
    for (i, lies) in lies.into_iter().enumerate() {
        let mut monitor = TwistMonitor::new();
        assert_eq!(drive(&mut monitor, 50, 0.0, |way_m| way_m), None);
        assert!(monitor.way(&measured(0.16), 0.0).is_some());
        let lie = drive(&mut monitor, 8, 0.0, lies).unwrap();
        assert!((lie.truth_m_s - 0.8).abs() < 0.1, "{i}: {lie:?}");
        assert!(monitor.are_refused() && monitor.way(&measured(0.16), 0.0).is_none());
        drive(&mut monitor, 8, 0.0, |way_m| way_m);
        assert!(monitor.are_refused(), "{i}");
        drive(&mut monitor, 12, 0.0, |way_m| way_m);
        assert!(!monitor.are_refused(), "{i}");
    }
}

/// Speeds up to 0.8 m/s in 1.6 s and goes on, the radar sees nothing; wheels turn as `wheels` says
/// by speed and time. Gives the first lie with its time.
fn speed_up(monitor: &mut TwistMonitor, wheels: impl Fn(f64, f64) -> f64) -> Option<(f64, Lie)> {
    let speed_m_s = |at_s: f64| (0.5 * at_s).min(0.8);
    for step in 1..30 {
        let (at_s, before_s) = (DT_S * f64::from(step), DT_S * f64::from(step - 1));
        let gained_m_s = speed_m_s(at_s) - speed_m_s(before_s) + 0.03 * DT_S;
        let mean_m_s = 0.5 * (speed_m_s(at_s) + speed_m_s(before_s));
        let measured = measured(wheels(mean_m_s, at_s) * DT_S);
        if let Some(lie) = monitor.observe_change(Some(&measured), Some(gained_m_s)) {
            return Some((at_s, lie));
        }
    }
    None
}

#[test]
fn a_change_of_speed_proves_wheels_or_refutes_them() {
    let mut monitor = TwistMonitor::new();
    assert_eq!(speed_up(&mut monitor, |speed, _| 1.02 * speed), None);
    assert!(monitor.way(&measured(0.16), 0.0).is_some());
    let lies: [fn(f64, f64) -> f64; 3] = [
        |_, _| 0.0,
        |speed, _| -speed,
        |speed, at_s| speed + if at_s > 3.0 { 1.0 } else { 0.0 },
    ];
    for (i, lies) in lies.into_iter().enumerate() {
        let mut monitor = TwistMonitor::new();
        let (at_s, _) = speed_up(&mut monitor, lies).unwrap();
        assert!(at_s < 3.5, "{i}: {at_s}");
        assert!(monitor.way(&measured(0.16), 0.0).is_none());
    }
}

#[test]
fn a_robot_that_stands_proves_nothing() {
    let mut monitor = TwistMonitor::new();
    for _ in 0..100 {
        let stands = (measured(0.0), 0.0);
        assert_eq!(
            monitor.observe_scan(Some(&stands), Some(Pose2::IDENTITY)),
            None
        );
        assert_eq!(monitor.observe_change(Some(&stands.0), Some(0.001)), None);
    }
    assert_eq!(monitor.way(&measured(0.16), 0.0), None);
}
