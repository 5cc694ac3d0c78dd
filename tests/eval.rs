//! `randt-lab eval` as a user calls it.

use crate::support::{lab, recording};
use randt_geometry::elementary::sin_cos;
use serde_json::Value;
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::process::Output;

fn eval(folder: &Path, arguments: &[&str]) -> Output {
    lab(&["eval"])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn stderr(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

/// TUM rows of a straight drive of half a metre a second.
fn drive(seconds: std::ops::Range<u32>) -> String {
    let row = |t: u32| format!("{t}.0 {:.1} 0 0 0 0 0 1\n", 0.5 * f64::from(t));
    seconds.map(row).collect()
}

#[test]
fn a_published_run_gives_its_published_figures() {
    let Some(folder) = recording("trajectories/randt/16-13-09/slam") else {
        return;
    };
    let output = eval(&folder, &["est.txt", "gt.txt", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let figures = json(&output);
    for (name, published) in [
        ("kitti_translation_percent", "1.54257"),
        ("kitti_rotation_deg_per_100m", "0.49098"),
        ("ate_rmse_m", "3.99550"),
        ("rpe_translation_mean_m", "0.10358"),
        ("rpe_rotation_mean_deg", "0.15467"),
        ("coverage", "1.00000"),
    ] {
        let found = format!("{:.5}", figures[name].as_f64().unwrap());
        assert_eq!(found, published, "{name}");
    }
    let again = eval(&folder, &["est.txt", "gt.txt", "--json"]);
    assert_eq!(again.stdout, output.stdout);
}

#[test]
fn people_get_a_table_and_programs_get_null() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.tum"), drive(0..20)).unwrap();
    let output = eval(folder.path(), &["a.tum", "a.tum"]);
    assert_eq!(output.status.code(), Some(0));
    let table = str::from_utf8(&output.stdout).unwrap();
    for words in ["100.0 %", "ATE", "0.0000 m", "no stretch of 100 m"] {
        assert!(table.contains(words), "{table}");
    }
    let output = eval(folder.path(), &["a.tum", "a.tum", "--json"]);
    assert_eq!(json(&output)["kitti_translation_percent"], Value::Null);
    assert_eq!(json(&output)["ate_rmse_m"], 0.0);
}

#[test]
fn too_little_coverage_ends_with_3() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("truth.tum"), drive(0..100)).unwrap();
    for (name, seconds, coverage) in [
        ("most.tum", 3..99, 0.96),
        ("part.tum", 10..99, 0.89),
        ("elsewhere.tum", 500..600, 0.0),
    ] {
        fs::write(folder.path().join(name), drive(seconds)).unwrap();
        let output = eval(folder.path(), &[name, "truth.tum", "--json"]);
        let expected = if coverage < 0.95 { 3 } else { 0 };
        assert_eq!(output.status.code(), Some(expected), "{name}");
        assert_eq!(json(&output)["coverage"], coverage, "{name}");
        if expected == 3 {
            assert!(
                stderr(&output).contains("the truth 0.000 to 99.000 s"),
                "{}",
                stderr(&output)
            );
        }
    }
}

#[test]
fn frames_are_reported_and_never_spliced() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("truth.tum"), drive(0..100)).unwrap();
    let row = |t: u32, x: f64| format!("{t}.0 0 {x:.1} 0 0 0 0.70710678 0.70710678\n");
    let first: String = (0..50).map(|t| row(t, 0.5 * f64::from(t))).collect();
    let second: String = (50..100)
        .map(|t| row(t, 0.5 * f64::from(t) - 90.0))
        .collect();
    let text = format!("# odom_frame_id 1 start\n{first}# odom_frame_id 2 gap of 1.5 s\n{second}");
    fs::write(folder.path().join("est.tum"), text).unwrap();
    let output = eval(folder.path(), &["est.tum", "truth.tum", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(stderr(&output).contains("2 frames"), "{}", stderr(&output));
    assert_eq!(json(&output)["frames"], 2);
    assert!(json(&output)["ate_rmse_m"].as_f64().unwrap() < 1e-6);
    assert!(json(&output)["rpe_translation_mean_m"].as_f64().unwrap() < 1e-6);
}

#[test]
fn what_is_no_trajectory_ends_with_1_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("good.tum", drive(0..20).as_bytes());
    write("empty.tum", b"");
    write("cut.tum", b"0.0 0 0 0 0 0 0 1\n1.0 0.5 0 0 0");
    write("bytes.tum", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
    write("back.tum", b"1.0 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 0 1\n");
    write("rows.kitti", b"1 0 0 0 0 1 0 0 0 0 1 0\n");
    write(
        "two.kitti",
        b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n",
    );
    for (estimate, truth, words) in [
        ("absent.tum", "good.tum", "absent.tum: No such file"),
        ("good.tum", ".", "trajectory.tum: No such file"),
        ("empty.tum", "good.tum", "empty.tum: no poses"),
        (
            "cut.tum",
            "good.tum",
            "cut.tum:2: 5 columns; a TUM row has 8",
        ),
        ("bytes.tum", "good.tum", "bytes.tum:1: not text"),
        (
            "good.tum",
            "back.tum",
            "back.tum:2: stamp 0.500000000 is not after",
        ),
        ("rows.kitti", "good.tum", "give both in one format"),
        (
            "rows.kitti",
            "two.kitti",
            "the estimate has 1 rows and the truth 2",
        ),
    ] {
        let output = eval(folder.path(), &[estimate, truth]);
        assert_eq!(output.status.code(), Some(1), "{estimate} {truth}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
    assert_eq!(eval(folder.path(), &["good.tum"]).status.code(), Some(2));
}

/// TUM rows of two rounds of 40 m on a circle, a quarter of a metre each quarter of a second.
fn two_rounds() -> String {
    let row = |n: u32| {
        let (sin, cos) = sin_cos(f64::from(n) * TAU / 160.0);
        let (z, w) = sin_cos(f64::from(n) * PI / 160.0);
        let (t, r) = (0.25 * f64::from(n), 40.0 / TAU);
        format!(
            "{t:.2} {:.6} {:.6} 0 0 0 {z:.9} {w:.9}\n",
            r * sin,
            r - r * cos
        )
    };
    (0..320).map(row).collect()
}

#[test]
fn loops_of_a_report_are_judged() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.tum"), two_rounds()).unwrap();
    let candidate = |status: &str, to_s: f64, x_m: f64| {
        let (from_ns, to_ns) = (((to_s - 40.0) * 1e9) as i64, (to_s * 1e9) as i64);
        format!(
            r#"{{"from_ns":{from_ns},"to_ns":{to_ns},"relative":[{x_m},0,0],"status":"{status}"}}"#
        )
    };
    let report = format!(
        r#"{{"scans":320,"loops":{{"candidates":[{},{},{}]}}}}"#,
        candidate("accepted", 60.0, 0.1),
        candidate("accepted", 70.0, 3.0),
        candidate("inconsistent", 50.0, 9.0),
    );
    fs::write(folder.path().join("report.json"), report).unwrap();
    let arguments = ["a.tum", "a.tum", "--loops", "report.json"];
    let output = eval(folder.path(), &[&arguments[..], &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let figures = json(&output);
    assert_eq!(figures["lost_track"], false);
    assert!(figures["worst_1s_translation_m"].as_f64().unwrap() < 1e-5);
    let loops = &figures["loops"];
    assert_eq!(loops["loops"], 2);
    assert_eq!(loops["false_loops"][0]["to_ns"], 70_000_000_000_i64);
    assert_eq!(loops["false_loops"].as_array().unwrap().len(), 1);
    // One true loop recalls 2 m of path either way, 17 poses of the second round.
    assert_eq!(
        (&loops["revisits"], &loops["recalled"]),
        (&164.into(), &17.into())
    );

    let output = eval(folder.path(), &arguments);
    let table = str::from_utf8(&output.stdout).unwrap();
    for words in [
        "track held",
        "1 false of 2",
        "17 of 164 revisits",
        "false loop: 30.000 s to 70.000 s is off by 3.00 m, 0.0 deg",
    ] {
        assert!(table.contains(words), "{table}");
    }
    let output = eval(
        folder.path(),
        &[&arguments[..], &["--false-loop-m", "4"]].concat(),
    );
    assert!(
        str::from_utf8(&output.stdout)
            .unwrap()
            .contains("0 false of 2")
    );
}

#[test]
fn what_is_no_report_ends_with_1_and_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.tum"), two_rounds()).unwrap();
    fs::write(folder.path().join("old.json"), r#"{"randt": "0.1.0"}"#).unwrap();
    for (report, words) in [
        ("absent.json", "absent.json: No such file"),
        ("old.json", "missing field `loops`"),
        ("a.tum", "a.tum: no report of a run"),
    ] {
        let output = eval(folder.path(), &["a.tum", "a.tum", "--loops", report]);
        assert_eq!(output.status.code(), Some(1), "{report}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
}

#[test]
fn metres_that_were_wrong_under_good_trust_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("truth.tum", &drive(0..100));
    // A metre too far from 50 s on.
    let row = |t: u32| {
        let x_m = 0.5 * f64::from(t) + if t < 50 { 0.0 } else { 1.0 };
        format!("{t}.0 {x_m:.1} 0 0 0 0 0 1\n")
    };
    write("est.tum", &(0..100).map(row).collect::<String>());
    let span = |begin_s: u64, scans: u64, trust: &str| {
        let begin_ns = begin_s * 1_000_000_000;
        format!(r#"{{"begin_ns":{begin_ns},"scans":{scans},"trust":"{trust}","imu":true}}"#)
    };
    let report = |spans: &[String]| format!(r#"{{"trust_spans":[{}]}}"#, spans.join(","));
    write("good.json", &report(&[span(0, 100, "good")]));
    let degraded = [
        span(0, 44, "good"),
        span(44, 12, "degraded"),
        span(56, 44, "good"),
    ];
    write("degraded.json", &report(&degraded));
    for (trust, silent_m, good_share) in [("good.json", 10, 1.0), ("degraded.json", 4, 0.88)] {
        let arguments = ["est.tum", "truth.tum", "--trust", trust];
        let output = eval(folder.path(), &[&arguments[..], &["--json"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let figures = json(&output);
        assert_eq!(
            (&figures["silent_m"], &figures["wrong_m"]),
            (&silent_m.into(), &10.into())
        );
        assert_eq!(figures["good_share"], good_share);
        let table = eval(folder.path(), &arguments);
        let words = format!("{silent_m} m of 10 m wrong");
        let table = str::from_utf8(&table.stdout).unwrap();
        assert!(table.contains(&words), "{table}");
    }
    write("old.json", "{}");
    let output = eval(
        folder.path(),
        &["est.tum", "truth.tum", "--trust", "old.json"],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("missing field `trust_spans`"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn evo_finds_the_same_error() {
    let folder = tempfile::tempdir().unwrap();
    let [truth, estimate] = ["truth.tum", "est.tum"].map(|name| folder.path().join(name));
    let row = |t: u32, x: f64, y: f64| {
        let yaw = 0.05 * f64::from(t);
        let (sin, cos) = sin_cos(0.5 * yaw);
        format!("{t}.250000000 {x:.9} {y:.9} 0 0 0 {sin:.9} {cos:.9}\n")
    };
    let path = |wrong: f64| {
        let rows = (0..60).map(|t| {
            let (sin, cos) = sin_cos(0.05 * f64::from(t));
            row(t, 20.0 * sin + wrong * f64::from(t % 3), 20.0 * (1.0 - cos))
        });
        format!("# odom_frame_id 0\n{}", rows.collect::<String>())
    };
    fs::write(&truth, path(0.0)).unwrap();
    fs::write(&estimate, path(0.1)).unwrap();
    let Some(mut evo) = crate::support::python::script("read_evo.py") else {
        return;
    };
    let evo = evo.arg(&estimate).arg(&truth).output().unwrap();
    assert!(evo.status.success(), "{}", stderr(&evo));
    let text = str::from_utf8(&evo.stdout).unwrap();
    let (poses, theirs) = text.trim().split_once(' ').unwrap();
    let ours = json(&eval(folder.path(), &["est.tum", "truth.tum", "--json"]));
    let apart = ours["ate_rmse_m"].as_f64().unwrap() - theirs.parse::<f64>().unwrap();
    assert_eq!(poses, "60");
    assert!(apart.abs() < 1e-9, "{text} {}", ours["ate_rmse_m"]);
}
