//! Trust in single solutions.

mod drives;

use super::*;
use nalgebra::{Matrix3, Vector3};
use randt_ndt::ScanCell;
use randt_persist::{Persist, Reader, Writer};

const SWEEP_NS: i64 = 200_000_000;

/// A scan of this number, of ten cells.
fn scan(number: i64) -> WindowScan {
    let mut scan = WindowScan {
        cells: vec![ScanCell::default(); 10],
        ..WindowScan::default()
    };
    scan.message.head.sweep.end_ns = number * SWEEP_NS;
    scan
}

/// A solution of this fit with that much information along the weaker direction of the position,
/// 1/m^2.
fn solution(fit: f64, weakest: f64) -> Solution {
    Solution {
        fit,
        scan_information: Matrix3::from_diagonal(&Vector3::new(20_000.0, weakest, 1e5)),
        ..Solution::default()
    }
}

/// Judges a scan by what the window makes of its cells and this solution.
fn judge(
    monitor: &mut TrackingMonitor,
    solution: &Solution,
    mut scan: WindowScan,
    config: &Config,
) -> TrackingStatus {
    let (information, fit) = (&solution.scan_information, solution.fit);
    scan.localizability = Localizability::from_information(information, fit, config);
    monitor.judge(solution, &scan, 0, config)
}

/// Judges scans of these fits, the direction being strong.
fn judged(fits: &[f64]) -> Vec<Trust> {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let judged = |(number, fit)| {
        let solution = solution(fit, 9000.0);
        judge(&mut monitor, &solution, scan(number), &config).trust()
    };
    (0..).zip(fits.iter().copied()).map(judged).collect()
}

#[test]
fn three_poor_fits_of_ten_are_doubted_for_a_second() {
    const GOOD: f64 = 0.41;
    const POOR: f64 = 0.39;
    assert_eq!(judged(&[GOOD; 20]), [Trust::Good; 20]);
    // Two, and a third that comes when the first one is forgotten.
    let mut fits = [GOOD; 30];
    (fits[3], fits[5], fits[13]) = (POOR, POOR, POOR);
    assert_eq!(judged(&fits), [Trust::Good; 30]);
    (fits[3], fits[4], fits[5]) = (POOR, POOR, POOR);
    fits[13] = GOOD;
    let trust = judged(&fits);
    // Doubted from the third one until a second after the first one is forgotten, eight scans
    // later.
    let doubted = (0..).zip(&trust).filter(|(_, t)| **t == Trust::Degraded);
    let doubted: Vec<usize> = doubted.map(|(scan, _)| scan).collect();
    assert_eq!(doubted, Vec::from_iter(5..=16));
    assert!(trust[17..].iter().all(|trust| *trust == Trust::Good));
}

#[test]
fn a_poor_fit_is_as_poor_under_every_loss() {
    let fit = |alpha: f64, scale: f64| {
        let mut config = Config::default();
        (config.odometry.loss_alpha, config.odometry.loss_scale) = (alpha, scale);
        fit_min(&config)
    };
    let close = |fit: f64, expected: f64| assert!((fit - expected).abs() < 0.001, "{fit}");
    // The profiles mixed, indoor, outdoor and oxford.
    close(fit(-1.5, 2.0), 0.400);
    close(fit(-2.0, 1.5), 0.233);
    close(fit(-1.0, 2.0), 0.413);
    close(fit(-2.0, 1.0), 0.086);
}

#[test]
fn a_weak_direction_is_known_by_cell_weight_and_slack() {
    let trust = |weakest: f64, change: fn(&mut Config)| {
        let mut config = Config::default();
        change(&mut config);
        let mut monitor = TrackingMonitor::default();
        let status = judge(&mut monitor, &solution(0.8, weakest), scan(0), &config);
        status.trust()
    };
    // 5.6 x 6 x 200 x 0.8 / 6 = 896.
    assert_eq!(trust(905.0, |_| ()), Trust::Good);
    assert_eq!(trust(885.0, |_| ()), Trust::Degraded);
    for (limit, change) in [
        (3584.0, (|c| c.ndt.cell_size_m = 0.5) as fn(&mut Config)),
        (448.0, |c| c.odometry.ndt_weight = 100.0),
        (5376.0, |c| c.ndt.slack = 0.0),
        (224.0, |c| c.sensor.cell_size_min_m = 2.0),
    ] {
        assert_eq!(trust(1.01 * limit, change), Trust::Good, "{limit}");
        assert_eq!(trust(0.99 * limit, change), Trust::Degraded, "{limit}");
    }
}

#[test]
fn a_sweep_of_two_senders_is_doubted_for_a_second() {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let trust: Vec<Trust> = (0..20)
        .map(|number| {
            let mut scan = scan(number);
            let sweep = &mut scan.message.head.sweep;
            sweep.contested = u64::from(number == 7);
            judge(&mut monitor, &solution(0.8, 9000.0), scan, &config).trust()
        })
        .collect();
    let doubted = (0..).zip(&trust).filter(|(_, t)| **t == Trust::Degraded);
    let doubted: Vec<usize> = doubted.map(|(scan, _)| scan).collect();
    assert_eq!(doubted, Vec::from_iter(7..=11));
}

#[test]
fn what_is_doubted_has_its_reasons_and_what_is_good_has_none() {
    use TrustReason::{Contested, Fit, Held, Rate, Unsupported, Weak};
    type Change = fn(&mut Solution, &mut WindowScan);
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let same: Change = |_, _| ();
    let poor: Change = |solution, _| solution.fit = 0.2;
    let weak: Change = |solution, _| solution.scan_information.m22 = 100.0;
    let few: Change = |solution, _| solution.fit = 0.0;
    let adrift: Change = |solution, _| {
        solution.fit = 0.0;
        (solution.covariance[(0, 0)], solution.covariance[(1, 1)]) = (1.0, 57.0);
    };
    let contested: Change = |_, scan| scan.message.head.sweep.contested = 1;
    let fast: Change = |_, scan| scan.state.velocity.x = 100.0;
    let steps: [(Change, &[TrustReason], Trust, Seen); 14] = [
        (same, &[], Trust::Good, Seen::Full),
        (weak, &[Weak], Trust::Degraded, Seen::Partial),
        (same, &[Held], Trust::Degraded, Seen::Full),
        (contested, &[Contested], Trust::Degraded, Seen::Full),
        (poor, &[Held], Trust::Degraded, Seen::Full),
        (poor, &[Held], Trust::Degraded, Seen::Full),
        (poor, &[Fit], Trust::Degraded, Seen::Full),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        // Motion model and IMU carry the pose as long as they know it well enough.
        (few, &[Unsupported, Fit], Trust::Degraded, Seen::None),
        (adrift, &[Unsupported, Fit], Trust::Lost, Seen::None),
        (fast, &[Fit, Rate], Trust::Lost, Seen::Full),
    ];
    for (number, (change, reasons, trust, seen)) in (0..).zip(steps) {
        let (mut solution, mut scan) = (solution(0.8, 9000.0), scan(number));
        change(&mut solution, &mut scan);
        let status = judge(&mut monitor, &solution, scan, &config);
        let found: Vec<_> = TrustReason::in_set(status.reasons).collect();
        assert_eq!((&found[..], status.trust()), (reasons, trust), "{number}");
        assert_eq!(status.localizability, seen as u32, "{number}");
        // The diagonal's weaker one is along y.
        let is_sideways = status.weak_direction_rad.abs() == std::f64::consts::FRAC_PI_2;
        assert_eq!(is_sideways, seen == Seen::Partial, "{number}");
    }
}

#[test]
fn where_the_position_drifted_trust_comes_back_after_its_metres() {
    let (mut monitor, config) = (TrackingMonitor::default(), Config::default());
    let mut judged = |number: i64, weakest: f64, variance_m2: f64| {
        let mut scan = scan(number);
        (scan.state.velocity.x, scan.dt_s) = (1.0, 0.2);
        let mut solution = solution(0.8, weakest);
        solution.covariance[(1, 1)] = variance_m2;
        let trust = judge(&mut monitor, &solution, scan, &config).trust();
        let position = solution.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        (trust, monitor.widen(&position, &Pose2::IDENTITY))
    };
    // Ten scans drift by 0.4 m; then all directions are seen again.
    for number in 0..10 {
        judged(number, 100.0, 0.016 * (number + 1) as f64);
    }
    let after: Vec<_> = (10..60)
        .map(|number| judged(number, 9000.0, 1e-4))
        .collect();
    let doubted = after
        .iter()
        .take_while(|(trust, _)| *trust == Trust::Degraded);
    let doubted = doubted.count();
    assert!((17..=25).contains(&doubted), "{doubted} scans of 0.2 m");
    assert!(
        after[doubted..]
            .iter()
            .all(|(trust, _)| *trust == Trust::Good)
    );
    // As long as it is within the metres, its covariance is published.
    assert!((after[0].1.m22 - 0.16).abs() < 1e-9 && after[0].1.m11 < 1e-9);
    assert!((after[49].1.m22 - 1e-4).abs() < 1e-12);
}

#[test]
fn what_else_was_found_against_a_pose_is_a_reason() {
    let config = Config::default();
    for found in [TrustReason::Imu, TrustReason::Moving] {
        let (mut monitor, mut scan) = (TrackingMonitor::default(), scan(0));
        scan.localizability.seen = Seen::Full;
        let status = monitor.judge(&solution(0.8, 9000.0), &scan, found as u32, &config);
        assert_eq!(status.trust(), Trust::Degraded);
        assert_eq!(status.reasons, found as u32);
    }
}

#[test]
fn what_is_remembered_survives_its_process() {
    let config = Config::default();
    let fits = [
        0.3, 0.8, 0.3, 0.8, 0.8, 0.3, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8,
    ];
    let (mut whole, mut killed) = (TrackingMonitor::default(), TrackingMonitor::default());
    for (number, fit) in (0..).zip(fits) {
        let judge = |monitor: &mut TrackingMonitor| {
            monitor.judge(&solution(fit, 9000.0), &scan(number), 0, &config)
        };
        assert_eq!(judge(&mut whole), judge(&mut killed), "scan {number}");
        let mut bytes = [0; 512];
        killed.save(&mut Writer::new(&mut bytes));
        killed = TrackingMonitor::default();
        killed.restore(&mut Reader::new(&bytes)).unwrap();
    }
    // More scans than are remembered cannot have been.
    let mut bytes = [0xff; 512];
    TrackingMonitor::default().save(&mut Writer::new(&mut bytes));
    bytes[4..8].copy_from_slice(&(1_u32 << FIT_SCANS).to_le_bytes());
    assert!(killed.restore(&mut Reader::new(&bytes)).is_err());
}
