//! How exact the program is on recordings, from the command to the figure.

use crate::support::{
    OUTPUTS, Row, ended, lab, names, pose_at, randt, recording, report, run, tum,
};
use randt_geometry::{Pose2, elementary::wrap};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// ATE of a bag's trajectory against its truth by `randt-lab eval`, m.
fn ate_m(bag: &str, truth: &str, profile: &str) -> Option<f64> {
    let (bag, truth) = (recording(bag)?, recording(truth)?);
    let folder = tempfile::tempdir().unwrap();
    let run = run(&bag, folder.path(), &["--profile", profile]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let mut command = lab(&["eval", "--json"]);
    command.arg(folder.path().join("odometry.tum")).arg(truth);
    let eval = ended(command);
    assert_eq!(eval.code, Some(0), "{}", eval.stderr);
    let figures: Value = serde_json::from_str(&eval.stdout).unwrap();
    println!("{} {profile}: {}", bag.display(), eval.stdout);
    assert_eq!(figures["frames"], 1, "one drive, one frame");
    figures["ate_rmse_m"].as_f64()
}

#[test]
fn the_room_with_the_indoor_profile() {
    let Some(ate_m) = ate_m("bags/room.bag", "bags/room_gt.tum", "indoor") else {
        return;
    };
    assert!(ate_m <= 0.015, "{ate_m} m");
}

#[test]
fn the_room_with_the_mixed_profile() {
    let Some(ate_m) = ate_m("bags/room.bag", "bags/room_gt.tum", "mixed") else {
        return;
    };
    assert!(ate_m <= 0.02, "{ate_m} m");
}

#[test]
fn two_laps_of_the_room_by_odometry_alone() {
    let Some(ate_m) = ate_m("bags/room_loops.bag", "bags/room_loops_gt.tum", "mixed") else {
        return;
    };
    assert!(ate_m <= 0.02, "{ate_m} m");
}

/// True poses at mid-sweep, the first at the origin; the file's y is to the right, ours to the
/// left.
fn oxford_truth(path: &Path) -> Vec<Row> {
    let text = fs::read_to_string(path).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|cell| *cell == name).unwrap();
    let [source, destination] = ["source_timestamp", "destination_timestamp"].map(column);
    let [x, y, yaw] = ["x", "y", "yaw"].map(column);
    let mut rows: Vec<Row> = Vec::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let value = |i: usize| cells[i].parse::<f64>().unwrap();
        let stamp_ns = |i: usize| cells[i].parse::<i64>().unwrap() * 1000;
        let row = |stamp_ns, pose| Row {
            stamp_ns,
            frame: 0,
            pose,
        };
        if rows.is_empty() {
            rows.push(row(stamp_ns(destination), Pose2::IDENTITY));
        }
        let last = rows.last().unwrap();
        assert_eq!(
            last.stamp_ns,
            stamp_ns(destination),
            "rows follow each other"
        );
        // It takes points of the newer scan into the older one's frame: the newer pose in the
        // older.
        let relative = Pose2::new(value(x), -value(y), -value(yaw));
        let pose = last.pose.compose(&relative);
        rows.push(row(stamp_ns(source), pose));
    }
    rows
}

fn mirrored(pose: &Pose2) -> Pose2 {
    Pose2::new(pose.x_m, -pose.y_m, -pose.yaw_rad)
}

/// How far an estimated motion is from the true one, m and degrees.
fn errors(estimate: &Pose2, truth: &Pose2) -> (f64, f64) {
    let distance_m = (estimate.translation() - truth.translation()).norm();
    (
        distance_m,
        wrap(estimate.yaw_rad - truth.yaw_rad).to_degrees().abs(),
    )
}

#[test]
fn a_braking_car_with_a_real_radar() {
    let Some(folder) = recording("radar/oxford") else {
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let run = run(&folder, out.path(), &["--profile", "oxford"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let estimate = tum(&out.path().join("odometry.tum"));
    assert_eq!(estimate.len(), 11);

    let truth = oxford_truth(&folder.join("gt/radar_odometry.csv"));
    // The listed scans are stamped at their first beam, the truth at mid-sweep.
    let listed = fs::read_to_string(folder.join("radar.timestamps")).unwrap();
    let first_beam_us: i64 = listed.split(' ').next().unwrap().parse().unwrap();
    let first = truth
        .iter()
        .position(|row| row.stamp_ns > first_beam_us * 1000)
        .unwrap();
    let (from, to) = (&truth[first + 1], &truth[first + 10]);
    let true_motion = from.pose.between(&to.pose);
    assert!(
        (16.9..17.1).contains(&true_motion.translation().norm()),
        "{true_motion:?}"
    );

    let motion = pose_at(&estimate, from.stamp_ns).between(&pose_at(&estimate, to.stamp_ns));
    let good = |(distance_m, angle_deg): (f64, f64)| distance_m <= 0.34 && angle_deg <= 1.0;
    let found = errors(&motion, &true_motion);
    println!(
        "end point off by {:.3} m and {:.3} degrees",
        found.0, found.1
    );
    assert!(
        good(found),
        "off by {found:?} (m, degrees): {motion:?}, truth {true_motion:?}"
    );
    let wrong = errors(&mirrored(&motion), &true_motion);
    assert!(!good(wrong), "a mirrored result would pass: {wrong:?}");
}

#[test]
fn two_real_scans_register() {
    let Some(folder) = recording("radar/oxford") else {
        return;
    };
    let image = |stamp: &str| folder.join("radar").join(stamp).with_extension("png");
    let mut command = lab(&["register", "--json", "--profile", "oxford"]);
    command.args([image("1547131050856549"), image("1547131051108813")]);
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let json: Value = serde_json::from_str(&ended.stdout).unwrap();
    let number = |name: &str| json[name].as_f64().unwrap();
    let motion = Pose2::new(number("x_m"), number("y_m"), number("yaw_deg").to_radians());

    let truth = oxford_truth(&folder.join("gt/radar_odometry.csv"));
    let [a, b] =
        ["stamp_a_ns", "stamp_b_ns"].map(|name| pose_at(&truth, json[name].as_i64().unwrap()));
    let true_motion = a.between(&b);
    let (distance_m, angle_deg) = errors(&motion, &true_motion);
    println!("off by {distance_m:.3} m and {angle_deg:.3} degrees");
    assert!(
        distance_m <= 0.15 && angle_deg <= 0.5,
        "off by {distance_m} m and {angle_deg} degrees: {json}, truth {true_motion:?}"
    );
    for i in 0..3 {
        assert!(json["covariance"][i][i].as_f64().unwrap() > 0.0, "{json}");
    }
    assert!(number("inliers") > 0.0);
}

#[test]
fn the_demo_is_good_and_names_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let mut command = randt(&["demo", "--scans", "150", "--out"]);
    command.arg(&out);
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    for words in ["ATE", "filter", "odometry", out.to_str().unwrap()] {
        assert!(
            ended.stdout.contains(words),
            "no {words} in: {}",
            ended.stdout
        );
    }
    let files = names(&out);
    assert!(
        OUTPUTS
            .iter()
            .all(|name| files.iter().any(|file| file == name)),
        "{files:?}"
    );
    let ate_m = report(&out)["accuracy"]["ate_rmse_m"].as_f64().unwrap();
    assert!(ate_m <= 0.15, "{ate_m} m");
}
