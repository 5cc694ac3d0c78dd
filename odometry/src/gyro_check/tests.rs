use super::*;
use crate::gyro_integrator::GyroTerm;
use nalgebra::{Matrix3, Vector3};
use randt_geometry::{Pose2, elementary::sin};

const SWEEP_NS: i64 = 200_000_000;
const DT_S: f64 = 0.2;
const CLEAR: ScanEvidence = ScanEvidence {
    is_clear: true,
    is_poor: false,
    yaw_variance: 1e-6,
    correspondence_information: 1.0,
};

/// A scan of this number at a heading, which by itself wants to turn by that much more.
fn scan(number: i64, yaw_rad: f64, wanted_deg: f64) -> WindowScan {
    let mut scan = WindowScan {
        dt_s: DT_S,
        gyro: Some(GyroTerm::default()),
        ..WindowScan::default()
    };
    scan.message.head.sweep.end_ns = number * SWEEP_NS;
    scan.state.odom_from_base = Pose2::new(1.0, 2.0, yaw_rad);
    scan.localizability.seen = Seen::Full;
    // Forward and yaw are known together, as they are where all walls lie to one side.
    scan.ndt.pose = Matrix3::new(900.0, 0.0, 200.0, 0.0, 900.0, 0.0, 200.0, 0.0, 5000.0);
    let step = Vector3::new(0.01, 0.0, wanted_deg.to_radians());
    scan.ndt.pose_gradient = -(scan.ndt.pose * step);
    scan
}

/// What the gyro measured up to a scan of this number.
fn measured(number: i64, angle_rad: f64) -> GyroMeasurement {
    let turn = Turn {
        angle_rad,
        uncovered_s: 0.0,
    };
    let term = GyroTerm {
        turn,
        ..GyroTerm::default()
    };
    GyroMeasurement {
        turn: Some(turn),
        span_ns: ((number - 1) * SWEEP_NS, number * SWEEP_NS),
        term: Some(term),
        ..GyroMeasurement::default()
    }
}

/// Takes a scan; gives what follows and what the gyro was admitted with.
fn step(check: &mut GyroCheck, number: i64, wanted_deg: f64) -> (Verdict, GyroMeasurement) {
    let admitted = check.admit(measured(number, 0.0), &GravityCheck::default());
    let scan = scan(number, 0.0, wanted_deg);
    let verdict = check.observe(&scan, &CLEAR, &GyroRates::default());
    (verdict, admitted)
}

/// The first verdict that changes something, and after how many scans.
fn first_verdict(wanted_deg: impl Fn(i64) -> f64) -> Option<(i64, Verdict)> {
    let mut check = GyroCheck::new();
    let verdicts = (1..=300).map(|number| (number, step(&mut check, number, wanted_deg(number)).0));
    verdicts
        .into_iter()
        .find(|(_, verdict)| *verdict != Verdict::Keep)
}

#[test]
fn noise_is_no_fault_and_a_mean_is() {
    let noise_deg = |number: i64| [0.5, -0.4, 0.3, -0.5, 0.1][number as usize % 5];
    assert_eq!(first_verdict(noise_deg), None);
    // A bias of 1 degree/s, a turned sign.
    let found = |mean_deg| first_verdict(move |number| mean_deg + 0.2 * noise_deg(number));
    let (scans, verdict) = found(1.6).unwrap();
    assert!(verdict == Verdict::Try && scans <= 10, "{scans}");
    let (scans, verdict) = found(10.0).unwrap();
    assert!(verdict == Verdict::Refuse && scans <= 3, "{scans}");
}

#[test]
fn a_bias_that_creeps_is_followed() {
    let mut check = GyroCheck::new();
    let followed = (1..=100).find(|number| {
        let (verdict, admitted) = step(&mut check, *number, 0.3);
        assert_eq!(verdict, Verdict::Keep);
        admitted.bias_change.variance > 0.0
    });
    assert!(followed.is_some());
}

#[test]
fn a_bias_is_unknown_where_the_scans_fit_no_better_without_the_gyro() {
    let mut check = GyroCheck::new();
    let tried = (1..).find(|number| step(&mut check, *number, 1.0).0 == Verdict::Try);
    let tried = tried.unwrap();
    check.keep(tried * SWEEP_NS);
    let (_, at_once) = step(&mut check, tried + 1, 0.0);
    let (_, then) = step(&mut check, tried + 2, 0.0);
    let sigmas = [at_once, then].map(|m| m.bias_change.variance.sqrt().to_degrees());
    assert!(
        sigmas[0] > 1.0 && sigmas[1] > 0.0 && sigmas[1] < 0.1,
        "{sigmas:?}"
    );
    // After a minute it is steady again.
    let (_, later) = step(&mut check, tried + 302, 0.0);
    assert_eq!(later.bias_change, BiasChange::default());
}

#[test]
fn a_refused_gyro_is_not_used_until_it_turns_as_the_radar_does() {
    let mut check = GyroCheck::new();
    check.refuse(0);
    let (mut yaw_rad, mut number) = (0.0, 0);
    let bias_rad_s = 0.02;
    let mut drive = |check: &mut GyroCheck, scans: i64, gyro: fn(f64) -> f64| {
        for _ in 0..scans {
            number += 1;
            let turn_rad = 0.1 * sin(0.1 * number as f64);
            yaw_rad += turn_rad;
            let gyro_rad = gyro(turn_rad) + bias_rad_s * DT_S;
            let admitted = check.admit(measured(number, gyro_rad), &GravityCheck::default());
            let used = admitted.term.is_some();
            check.observe(&scan(number, yaw_rad, 0.0), &CLEAR, &GyroRates::default());
            if used {
                return Some(admitted.bias_change.mean_rad_s);
            }
        }
        None
    };
    assert_eq!(drive(&mut check, 100, |turn_rad| 0.5 * turn_rad), None);
    assert!(
        matches!(check.fault(), GyroFault::Scaled(..)),
        "{}",
        check.fault()
    );
    // What is known to be so stays so.
    assert_eq!(drive(&mut check, 200, |turn_rad| turn_rad), None);
    let mut check = GyroCheck::new();
    check.refuse(0);
    assert!(check.is_undecided(10 * SWEEP_NS));
    let earned_rad_s = drive(&mut check, 100, |turn_rad| turn_rad).unwrap();
    assert!((earned_rad_s - bias_rad_s).abs() < 1e-3, "{earned_rad_s}");
    assert!(!check.is_refused());
}

#[test]
fn stamps_that_are_late_are_shown_by_turns_and_then_set_right() {
    let mut check = GyroCheck::new();
    check.refuse(0);
    let heading_rad = |at_s: f64| 0.8 * sin(0.7 * at_s);
    let mut late_s = 0.3;
    let mut drive = |check: &mut GyroCheck, numbers: std::ops::Range<i64>| {
        for number in numbers {
            let at_s = DT_S * number as f64;
            let gyro_rad = heading_rad(at_s - late_s) - heading_rad(at_s - late_s - DT_S);
            check.admit(measured(number, gyro_rad), &GravityCheck::default());
            let scan = scan(number, heading_rad(at_s), 0.0);
            let verdict = check.observe(&scan, &CLEAR, &GyroRates::default());
            if let Verdict::Late(late_ns) = verdict {
                late_s -= late_ns as f64 * 1e-9;
                check.set_late(late_ns);
                return Some(late_ns);
            }
        }
        None
    };
    let late_ns = drive(&mut check, 1..60).unwrap();
    assert!((late_ns - 300_000_000).abs() < 20_000_000, "{late_ns}");
    assert!(check.is_refused() && matches!(check.fault(), GyroFault::Delayed(_)));
    // Read by the right stamps it agrees, and what was wrong keeps its name.
    assert_eq!(drive(&mut check, 60..160), None);
    assert!(!check.is_refused());
    assert!(matches!(check.fault(), GyroFault::Delayed(_)));
}

#[test]
fn a_turn_out_of_nothing_that_does_not_fit_is_tried_at_once() {
    let poor = ScanEvidence {
        is_poor: true,
        ..CLEAR
    };
    let verdict = |turn_rad: f64| {
        let mut check = GyroCheck::new();
        for number in 1..10 {
            step(&mut check, number, 0.0);
        }
        check.admit(measured(10, turn_rad), &GravityCheck::default());
        check.observe(&scan(10, turn_rad, 0.0), &poor, &GyroRates::default())
    };
    assert_eq!((verdict(0.5), verdict(0.1)), (Verdict::Try, Verdict::Keep));
}

/// A clock that steps by 0.3 s after a minute, and nothing else: the scans take back a fifth of
/// what the yaw is off by.
#[test]
fn a_clock_that_steps_where_samples_lack_is_found_within_a_turn() {
    let mut check = GyroCheck::new();
    let heading_rad = |at_s: f64| 0.3 * sin(0.4 * at_s);
    let mut off_rad = 0.0;
    let found = (1..400).find_map(|number| {
        let at_s = DT_S * number as f64;
        let late_s = if number > 300 { 0.3 } else { 0.0 };
        let turn_rad = |at_s: f64| heading_rad(at_s) - heading_rad(at_s - DT_S);
        let gyro_rad = turn_rad(at_s - late_s);
        let mut measured = measured(number, gyro_rad);
        if number == 301 {
            measured.term = None;
            measured.turn.as_mut()?.uncovered_s = 0.2;
        }
        let admitted = check.admit(measured, &GravityCheck::default());
        off_rad = 0.8 * (off_rad + gyro_rad - turn_rad(at_s));
        let noise_deg = [0.5, -0.4, 0.3, -0.5, 0.1][number as usize % 5];
        let wanted_deg = (-off_rad).to_degrees() + 0.3 * noise_deg;
        let mut scan = scan(number, heading_rad(at_s) + off_rad, wanted_deg);
        scan.gyro = admitted.term.map(|term| GyroTerm {
            rate_rad_s: gyro_rad / DT_S,
            ..term
        });
        let evidence = ScanEvidence {
            correspondence_information: 20.0,
            ..CLEAR
        };
        let verdict = check.observe(&scan, &evidence, &GyroRates::default());
        assert_eq!(
            check.is_undecided(number * SWEEP_NS),
            (302..311).contains(&number)
        );
        (verdict != Verdict::Keep).then_some((number - 300, verdict))
    });
    let (scans, verdict) = found.unwrap();
    let Verdict::Late(late_ns) = verdict else {
        panic!("{verdict:?}");
    };
    assert!(
        scans < 30 && (200_000_000..400_000_000).contains(&late_ns),
        "{scans} {late_ns}"
    );
}

#[test]
fn samples_that_lack_again_and_again_are_no_clock_that_steps() {
    let mut check = GyroCheck::new();
    let undecided = (1..200).filter(|number| {
        let mut measured = measured(*number, 0.0);
        if number % 5 == 0 {
            measured.term = None;
            measured.turn = measured.turn.map(|turn| Turn {
                uncovered_s: 0.15,
                ..turn
            });
        }
        check.admit(measured, &GravityCheck::default());
        check.observe(&scan(*number, 0.0, 0.0), &CLEAR, &GyroRates::default());
        check.is_undecided(number * SWEEP_NS)
    });
    // After the first hole, until the second one comes.
    assert_eq!(undecided.collect::<Vec<_>>(), [6, 7, 8, 9]);
}

#[test]
fn gravity_that_points_down_and_impossible_rates_refuse_it_at_once() {
    let mut gravity = GravityCheck::default();
    gravity.push(1, [0.0, 0.0, -9.8].into());
    let mut check = GyroCheck::new();
    assert!(check.admit(measured(1, 0.0), &gravity).term.is_none());
    assert_eq!(check.fault(), GyroFault::UpsideDown);
    assert!(!check.is_undecided(SWEEP_NS));

    let mut check = GyroCheck::new();
    let degrees = measured(1, 0.5 * 57.3 * DT_S);
    assert!(
        check
            .admit(degrees, &GravityCheck::default())
            .term
            .is_none()
    );
    assert!(check.is_refused());
}

#[test]
fn it_survives_its_process() {
    use randt_persist::{Persist, Reader, Writer};
    let mut whole = GyroCheck::new();
    for number in 1..50 {
        step(&mut whole, number, 0.3);
    }
    let mut bytes = vec![0; 1 << 14];
    whole.save(&mut Writer::new(&mut bytes));
    let mut restored = GyroCheck::new();
    restored.restore(&mut Reader::new(&bytes)).unwrap();
    let after = |check: &mut GyroCheck| {
        (50..200).find(|number| step(check, *number, 0.3).0 != Verdict::Keep)
    };
    assert_eq!(after(&mut restored), after(&mut whole));
}
