//! `randt-lab ablation` as a user calls it, on short drives.

use crate::support::{Ended, ended, lab, names};
use serde_json::Value;
use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Half a minute: past the standstill at the begin and through a door.
const SHORT: [&str; 2] = ["--scans", "150"];
const VARIANTS: [&str; 7] = [
    "all",
    "no intensity dimension",
    "l = 1",
    "no graduation",
    "no IMU",
    "no de-skew",
    "no loops",
];

fn ablation(more: &[&str]) -> Ended {
    let mut command = lab(&["ablation"]);
    command.args(SHORT).args(more);
    ended(command)
}

/// The object that was printed, times left out.
fn figures(more: &[&str]) -> Value {
    let ended = ablation(&[&["--json"], more].concat());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let mut figures: Value = serde_json::from_str(&ended.stdout).unwrap();
    for world in figures["worlds"].as_array_mut().unwrap() {
        for row in world["rows"].as_array_mut().unwrap() {
            for time in ["median_ms", "p99_ms"] {
                let time_ms = row.as_object_mut().unwrap().remove(time).unwrap();
                assert!(time_ms.as_f64().unwrap() > 0.0, "{row}");
            }
        }
    }
    figures
}

#[test]
fn every_part_that_is_left_out_makes_a_difference() {
    let figures = figures(&["--worlds", "tunnel,building"]);
    let worlds = figures["worlds"].as_array().unwrap();
    let names: Vec<&str> = worlds
        .iter()
        .map(|w| w["world"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["tunnel", "building"], "in the order asked for");
    for world in worlds {
        assert_eq!(world["scans"], 150);
        let rows = world["rows"].as_array().unwrap();
        let variants: Vec<&str> = rows
            .iter()
            .map(|row| row["variant"].as_str().unwrap())
            .collect();
        assert_eq!(variants, VARIANTS);
        let ate_m = |row: usize| rows[row]["ate_rmse_m"].as_f64().unwrap();
        for (row, variant) in VARIANTS.iter().enumerate() {
            println!("{} {variant}: {:.4} m", world["world"], ate_m(row));
            for figure in ["worst_1s_translation_m", "worst_1s_rotation_deg"] {
                assert!(rows[row][figure].as_f64().unwrap() > 0.0, "{variant}");
            }
            assert_eq!(rows[row]["false_loops"], 0, "{variant}");
        }
        // Nothing is seen again so early: the loops are missed by nobody, every other part is.
        assert_eq!(rows[0]["loops"], 0);
        for (row, variant) in VARIANTS.iter().enumerate().skip(1) {
            let differs = ate_m(row) != ate_m(0);
            assert_eq!(differs, *variant != "no loops", "{variant}");
        }
    }
}

#[test]
fn the_figures_are_the_same_twice_and_seeds_are_put_together() {
    let one = figures(&["--worlds", "yard"]);
    assert_eq!(one, figures(&["--worlds", "yard"]));
    assert_eq!(one["seeds"], serde_json::json!([1]));
    let two = figures(&["--worlds", "yard", "--seeds", "2"]);
    assert_eq!(two["seeds"], serde_json::json!([1, 2]));
    let number = |figures: &Value, name: &str| {
        let value = &figures["worlds"][0]["rows"][0][name];
        value.as_f64().unwrap()
    };
    assert_ne!(number(&one, "ate_rmse_m"), number(&two, "ate_rmse_m"));
    let worst = "worst_1s_translation_m";
    assert!(
        number(&one, worst) <= number(&two, worst),
        "the worst of all"
    );
}

#[test]
fn the_table_is_aligned_and_written_as_it_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ablation.md");
    let out = ["--worlds", "tunnel", "--out", path.to_str().unwrap()];
    let ended = ablation(&[&out[..], &["--profile", "indoor"]].concat());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(fs::read_to_string(&path).unwrap(), ended.stdout);
    assert_eq!(names(folder.path()), ["ablation.md"]);

    let rows: Vec<&str> = ended
        .stdout
        .lines()
        .filter(|line| line.starts_with('|'))
        .collect();
    assert_eq!(rows.len(), 2 + VARIANTS.len(), "{}", ended.stdout);
    let columns = |row: &str| -> Vec<usize> { row.match_indices('|').map(|(i, _)| i).collect() };
    for (row, variant) in rows.iter().skip(2).zip(VARIANTS) {
        assert!(row.starts_with(&format!("| {variant} ")), "{row}");
        assert_eq!(columns(row), columns(rows[0]), "{}", ended.stdout);
    }
    for words in ["ATE, m", "worst 1 s", "false loops", "recall", "scan, ms"] {
        assert!(rows[0].contains(words), "{}", rows[0]);
    }
    for words in ["### tunnel: 150 scans", "profile indoor", "seed 1", " x "] {
        assert!(ended.stdout.contains(words), "{}", ended.stdout);
    }
}

#[test]
fn wrong_arguments_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().to_str().unwrap();
    for (arguments, code, printed) in [
        (&["--worlds", "castle"][..], 2, "castle"),
        (&["--seeds", "0"], 2, "--seeds"),
        (&["--scans", "0"], 2, "--scans"),
        (&["--set", "odometry.windw=2"], 78, "odometry.window"),
        (&["--out", taken], 1, "is not a plain file"),
    ] {
        let mut command = lab(&["ablation"]);
        command.args(arguments);
        let ended = ended(command);
        assert_eq!(ended.code, Some(code), "{arguments:?}: {}", ended.stderr);
        assert!(ended.stderr_contains(printed), "{}", ended.stderr);
        assert_eq!(ended.stdout, "");
    }
}

#[test]
fn ctrl_c_ends_it_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = lab(&["ablation", "--out", "ablation.md"])
        .current_dir(&folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    assert!(child.try_wait().unwrap().is_none(), "it takes a minute");
    let mut kill = Command::new("kill");
    kill.arg("-INT").arg(child.id().to_string());
    assert!(kill.status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("interrupted"), "{stderr}");
    assert!(names(folder.path()).is_empty());
}
