//! Drives made by formula: what is known is found, and what a drive does not show is refused.
#![allow(clippy::unwrap_used, reason = "a test reports failures by panicking")]

use proptest::prelude::*;
use randt_calibration::{Gyro, RadarPose, Unobservable, YawRate, mounting, time_offset};
use randt_geometry::{
    Pose2,
    elementary::{cos, sin},
};

const SWEEP_NS: i64 = 200_000_000;
const SAMPLE_NS: i64 = 4_000_000;
/// Within a sweep the robot is moved in this many steps.
const STEPS: usize = 50;

/// A part of a drive: seconds, forward m/s, yaw rate rad/s.
type Leg = (f64, f64, f64);

/// The radar's poses, of a radar mounted so.
fn drive(legs: &[Leg], radar: Pose2) -> Vec<RadarPose> {
    let mut base = Pose2::new(3.0, -1.0, 0.4);
    let mut poses = Vec::new();
    for (seconds, speed, rate) in legs {
        for _ in 0..(seconds * 5.0) as usize {
            poses.push(RadarPose {
                stamp_ns: poses.len() as i64 * SWEEP_NS,
                frame: 0,
                pose: base.compose(&radar),
                fixed: true,
            });
            for _ in 0..STEPS {
                let dt = 0.2 / STEPS as f64;
                base = base.compose(&Pose2::exp([speed * dt, 0.0, rate * dt].into()));
            }
        }
    }
    poses
}

/// Straights, curves, turns in place to both sides.
fn full() -> Vec<Leg> {
    let round = [
        (6.0, 0.7, 0.0),
        (3.0, 0.5, 0.4),
        (8.0, 0.0, 0.6),
        (1.0, 0.0, 0.0),
        (6.0, 0.8, 0.0),
        (3.0, 0.4, -0.5),
        (8.0, 0.0, -0.6),
    ];
    round.repeat(3)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn a_mounting_is_found(x in -0.5..0.5f64, y in -0.5..0.5f64, yaw in -3.1..3.1f64) {
        let found = mounting(&drive(&full(), Pose2::new(x, y, yaw)));
        let heading = found.yaw.unwrap();
        let lever_arm = found.lever_arm.unwrap();
        prop_assert!((heading.yaw_rad.value - yaw).abs() < 1e-3, "{heading:?}");
        prop_assert!((lever_arm.x_m.value - x).abs() < 2e-3, "{lever_arm:?}");
        prop_assert!((lever_arm.y_m.value - y).abs() < 2e-3, "{lever_arm:?}");
        prop_assert!(lever_arm.x_m.sigma < 0.01 && heading.yaw_rad.sigma < 0.01);
        prop_assert!(!heading.spans.is_empty() && !lever_arm.pivot.spans.is_empty());
    }

    #[test]
    fn an_offset_is_found(late_ms in -300.0..300.0f64, bias in -0.02..0.02f64) {
        let (poses, gyro) = swinging(late_ms, bias, 0.5);
        let found = time_offset(&poses, &gyro).unwrap();
        prop_assert!((found.late_s.value * 1e3 - late_ms).abs() < 0.05, "{found:?}");
        prop_assert!(found.scale.abs() < 1e-3, "{found:?}");
    }
}

/// A robot that swings left and right, in two rhythms, and its gyro.
fn swinging(late_ms: f64, bias: f64, size: f64) -> (Vec<RadarPose>, Gyro) {
    let yaw = |t: f64| size * (sin(1.1 * t) / 1.1 + sin(0.37 * t) / 0.37);
    let rate = |t: f64| size * (cos(1.1 * t) + cos(0.37 * t));
    let pose = |i: i64| RadarPose {
        stamp_ns: i * SWEEP_NS + (late_ms * 1e6) as i64,
        frame: 0,
        pose: Pose2::new(0.0, 0.0, yaw((i * SWEEP_NS) as f64 * 1e-9)),
        fixed: true,
    };
    let sample = |i: i64| YawRate {
        stamp_ns: i * SAMPLE_NS,
        rate_rad_s: rate((i * SAMPLE_NS) as f64 * 1e-9) + bias,
    };
    let poses = (10..400).map(pose).collect();
    let samples: Vec<YawRate> = (0..25_000).map(sample).collect();
    (poses, Gyro::new(&samples))
}

#[test]
fn a_straight_drive_shows_the_yaw_and_nothing_else() {
    let poses = drive(&[(40.0, 0.6, 0.0)], Pose2::new(0.2, -0.1, 0.05));
    let found = mounting(&poses);
    assert!((found.yaw.unwrap().yaw_rad.value - 0.05).abs() < 1e-6);
    assert!(matches!(
        found.lever_arm,
        Err(Unobservable::TurnsInPlace { .. })
    ));
    let still: Vec<YawRate> = (0..12_000)
        .map(|i| YawRate {
            stamp_ns: i * SAMPLE_NS,
            rate_rad_s: 0.01,
        })
        .collect();
    let refused = time_offset(&poses, &Gyro::new(&still)).unwrap_err();
    assert!(
        matches!(refused, Unobservable::Turning { turning: 0, .. }),
        "{refused}"
    );
}

#[test]
fn turns_in_place_alone_show_a_distance_without_a_direction() {
    let legs = [(12.0, 0.0, 0.6), (12.0, 0.0, -0.6)].repeat(2);
    let found = mounting(&drive(&legs, Pose2::new(0.3, 0.4, 1.0)));
    assert!(matches!(found.yaw, Err(Unobservable::Straight { .. })));
    match found.lever_arm {
        Err(Unobservable::Direction { distance_m }) => assert!((distance_m - 0.5).abs() < 1e-3),
        other => panic!("{other:?}"),
    }
}

#[test]
fn arcs_are_no_turns_in_place() {
    let legs = [(6.0, 0.8, 0.0), (6.0, 0.3, 0.6), (6.0, 0.3, -0.6)].repeat(4);
    let found = mounting(&drive(&legs, Pose2::new(0.2, 0.0, 0.0)));
    assert!(matches!(
        found.lever_arm,
        Err(Unobservable::TurnsInPlace { .. })
    ));
}

#[test]
fn turns_to_one_side_are_not_enough() {
    let legs = [(6.0, 0.8, 0.0), (12.0, 0.0, 0.6)].repeat(4);
    let found = mounting(&drive(&legs, Pose2::new(0.2, 0.0, 0.0)));
    match found.lever_arm {
        Err(Unobservable::TurnsInPlace {
            left_deg,
            right_deg,
            ..
        }) => assert!(
            left_deg > 1000.0 && right_deg == 0.0,
            "{left_deg} {right_deg}"
        ),
        other => panic!("{other:?}"),
    }
}

#[test]
fn driving_backward_shows_the_same_yaw() {
    let legs = [(6.0, 0.8, 0.0), (4.0, -0.5, 0.0)].repeat(4);
    let found = mounting(&drive(&legs, Pose2::new(0.2, 0.1, 0.3)));
    assert!((found.yaw.unwrap().yaw_rad.value - 0.3).abs() < 1e-6);
}

#[test]
fn a_steady_turn_shows_no_offset() {
    let poses = drive(&[(80.0, 0.0, 0.5)], Pose2::IDENTITY);
    let samples: Vec<YawRate> = (-500..25_000)
        .map(|i| YawRate {
            stamp_ns: i * SAMPLE_NS,
            rate_rad_s: 0.5,
        })
        .collect();
    let refused = time_offset(&poses, &Gyro::new(&samples)).unwrap_err();
    assert!(matches!(refused, Unobservable::Turning { .. }), "{refused}");
}

#[test]
fn a_gyro_upside_down_is_not_believed() {
    let (poses, _) = swinging(0.0, 0.0, 0.5);
    let (_, gyro) = swinging(0.0, 0.0, -0.5);
    let refused = time_offset(&poses, &gyro).unwrap_err();
    assert!(matches!(refused, Unobservable::Unlike { .. }), "{refused}");
}

#[test]
fn a_hole_in_the_gyro_costs_the_stretches_that_it_touches() {
    let (poses, _) = swinging(20.0, 0.0, 0.5);
    let samples = |skip: std::ops::Range<i64>| -> Vec<YawRate> {
        let rate = |t: f64| 0.5 * (cos(1.1 * t) + cos(0.37 * t));
        let times = (0..25_000i64).filter(|i| !skip.contains(i));
        let sample = |i: i64| YawRate {
            stamp_ns: i * SAMPLE_NS,
            rate_rad_s: rate((i * SAMPLE_NS) as f64 * 1e-9),
        };
        times.map(sample).collect()
    };
    let whole = time_offset(&poses, &Gyro::new(&samples(0..0))).unwrap();
    let holed = time_offset(&poses, &Gyro::new(&samples(7000..7100))).unwrap();
    assert!(holed.turned_rad < whole.turned_rad);
    assert!((holed.late_s.value - 0.02).abs() < 1e-4, "{holed:?}");
}
