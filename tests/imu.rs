//! `randt-lab imu` on real recordings: a Phidgets Spatial hung upside down, and an IMU with
//! optical truth (BROAD).

use crate::support::{lab, recording};
use randt_geometry::{Quaternion, elementary};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

fn randt_imu(arguments: &[&str]) -> Output {
    lab(&["imu"]).args(arguments).output().unwrap()
}

fn examined(path: &Path, more: &[&str]) -> Value {
    let output = randt_imu(&[&[path.to_str().unwrap(), "--json"], more].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// One row of the recording with truth: stamp, true rotation where the cameras saw it, whether it
/// moved.
struct Truth {
    stamp_s: f64,
    rotation: Option<Quaternion>,
    moving: bool,
}

fn truth(path: &Path) -> Vec<Truth> {
    let text = fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|row| {
            let v: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
            let seen = v[7..11].iter().all(|c| c.is_finite());
            Truth {
                stamp_s: v[0] * 1e-9,
                rotation: seen.then(|| Quaternion::new(v[7], v[8], v[9], v[10])),
                moving: v[11] != 0.0,
            }
        })
        .collect()
}

/// Degrees by which the estimated heading is off at an instant; the frames are aligned at the
/// start.
fn heading_error_deg(estimate: &Path, truth: &[Truth], at_s: f64) -> f64 {
    let text = fs::read_to_string(estimate).unwrap();
    let rotations: Vec<Quaternion> = text
        .lines()
        .map(|row| {
            let v: Vec<f64> = row.split(' ').map(|cell| cell.parse().unwrap()).collect();
            Quaternion::new(v[7], v[4], v[5], v[6])
        })
        .collect();
    assert_eq!(rotations.len(), truth.len(), "a row a sample");
    let mut offsets = truth
        .iter()
        .zip(&rotations)
        .filter_map(|(truth, estimate)| {
            Some((
                truth.stamp_s,
                estimate.multiply(&truth.rotation?.conjugate()),
            ))
        });
    let (_, start) = offsets.next().unwrap();
    let (_, then) = offsets.find(|(stamp_s, _)| *stamp_s >= at_s).unwrap();
    let error = then.multiply(&start.conjugate());
    elementary::wrap(2.0 * elementary::atan2(error.z, error.w))
        .to_degrees()
        .abs()
}

#[test]
fn standstills_are_found_without_the_flag() {
    let Some(path) = recording("imu/broad_04.csv") else {
        return;
    };
    let standstills = examined(&path, &[])["standstills"].clone();
    let found = |stamp_s: f64| {
        standstills.as_array().unwrap().iter().any(|span| {
            let (begin, end) = (&span["begin_s"], &span["end_s"]);
            (begin.as_f64().unwrap()..=end.as_f64().unwrap()).contains(&stamp_s)
        })
    };
    let truth = truth(&path);
    let count = |condition: &dyn Fn(&Truth) -> bool| truth.iter().filter(|t| condition(t)).count();
    let still = count(&|t| !t.moving);
    let both = count(&|t| !t.moving && found(t.stamp_s));
    let wrong = count(&|t| t.moving && found(t.stamp_s));
    let share = |part: usize| part as f64 / still as f64;
    assert!(share(both) >= 0.9, "overlap {:.3}", share(both));
    assert!(share(wrong) <= 0.01, "falsely still {:.3}", share(wrong));
}

#[test]
fn the_bias_is_that_of_the_long_standstill() {
    let Some(path) = recording("imu/broad_04.csv") else {
        return;
    };
    let bias = numbers(&examined(&path, &[])["bias_deg_s"]);
    for (axis, expected) in [-0.103, -0.085, 0.457].into_iter().enumerate() {
        assert!(
            (bias[axis] - expected).abs() <= 0.02,
            "axis {axis}: {bias:?} deg/s"
        );
    }
}

#[test]
fn the_heading_follows_3100_degrees_of_turning() {
    let Some(path) = recording("imu/broad_04.csv") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let truth = truth(&path);
    let run = |name: &str, more: &[&str]| {
        let tum = folder.path().join(name);
        let json = examined(
            &path,
            &[&["--attitude", tum.to_str().unwrap()], more].concat(),
        );
        let errors = [58.0, 89.99].map(|at_s| heading_error_deg(&tum, &truth, at_s));
        (json, errors)
    };
    let (json, [early, late]) = run("with.tum", &[]);
    assert!(early <= 1.5, "{early} degrees at 58 s");
    assert!(late <= 4.5, "{late} degrees at 90 s");
    let turned = json["turned_deg"].as_f64().unwrap();
    assert!(
        (2900.0..3300.0).contains(&turned),
        "turned {turned} degrees"
    );

    // Nothing is that still: no standstill, no bias.
    let (json, blind) = run(
        "without.tum",
        &["--set", "attitude.standstill_rate_rad_s=1e-9"],
    );
    assert!(json["bias_deg_s"].is_null());
    for (with, without) in [early, late].into_iter().zip(blind) {
        assert!(
            with <= without / 5.0,
            "{with} degrees with bias, {without} without"
        );
    }
}

#[test]
fn a_phidgets_spatial_upside_down_is_recognised_and_its_bias_is_small() {
    let Some(path) = recording("imu/phidgets_imu_upside_down.bag") else {
        return;
    };
    let json = examined(&path, &[]);
    assert_eq!(json["format"], "ros1-bag");
    assert_eq!(json["upside_down"], true);
    assert_eq!(json["mounting"]["up_axis"], "-z");
    assert!(json["upside_down_known_after_s"].as_f64().unwrap() <= 2.0);
    let bias = numbers(&json["bias_deg_s"]);
    assert!(bias.iter().all(|b| b.abs() <= 0.06), "{bias:?} deg/s");
    let rate = json["sampling"]["sample_rate_hz"].as_f64().unwrap();
    assert!((245.0..255.0).contains(&rate), "{rate} Hz");
    assert_eq!(json["sampling"]["gaps"], 0);
}

#[test]
fn two_runs_print_the_same_bytes() {
    let Some(path) = recording("imu/broad_04.csv") else {
        return;
    };
    let run = || randt_imu(&[path.to_str().unwrap()]).stdout;
    let first = run();
    assert!(!first.is_empty());
    assert_eq!(first, run());
}

#[test]
fn broken_tables_end_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let header = "stamp_ns,wx,wy,wz,ax,ay,az\n";
    let cases = [
        ("empty.csv", String::new(), 1, "is empty"),
        (
            "words.csv",
            "to be or not\n".to_owned(),
            1,
            "line 1: no column stamp",
        ),
        ("header.csv", header.to_owned(), 1, "no IMU sample"),
        ("good.csv", format!("{header}0,0,0,0,0,0,9.8\n"), 0, ""),
        (
            "row.csv",
            format!("{header}0,0,0,0,0,0,9.8\n4000000,0,0\n"),
            3,
            "line 3: 3 columns",
        ),
        (
            "nan.csv",
            format!("{header}0,0,0,0,0,0,9.8\n4000000,nan,0,0,0,0,9.8\n"),
            3,
            "",
        ),
    ];
    for (name, content, code, reason) in cases {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let output = randt_imu(&[path.to_str().unwrap()]);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{name}: {errors}");
        assert!(errors.contains(reason), "{name}: {errors}");
        assert!(reason.is_empty() || errors.contains(name), "{errors}");
    }
    let absent = randt_imu(&[folder.path().join("absent.bag").to_str().unwrap()]);
    assert_eq!(absent.status.code(), Some(1));
}

#[test]
fn an_attitude_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.csv");
    fs::write(&path, "stamp_ns,wx,wy,wz,ax,ay,az\n0,0,0,0,0,0,9.8\n").unwrap();
    let tum = folder.path().join("no-such-folder").join("attitude.tum");
    let output = randt_imu(&[path.to_str().unwrap(), "--attitude", tum.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("attitude.tum"));
}
