//! `randt calibrate` on simulated drives: what is found, how far it is off, and what is refused.

use crate::support::{Ended, drive, ended_within, randt};
use randt_simulator::{Event, Robot, Simulation, World};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A drive is simulated and computed some six times; test machines are slow.
const TIME_MAX: Duration = Duration::from_secs(300);
/// Sweeps of a calibration drive: five minutes.
const SCANS: &str = "1500";
/// What the drives are made with.
const LATE_MS: f64 = 30.0;
const YAW_DEG: f64 = 3.0;
const LEVER_ARM_M: [f64; 2] = [0.20, -0.10];

/// A hall of 80 m with something at the walls; the route is one straight for the first minute and
/// a half.
const STRAIGHT: &str = "
wall concrete 0,0 80,0 80,7 0,7 0,0 doors 5..6 14..15.5 31..32 49..50.2 61..62
block metal 6,0.1 0.8x0.4
block wood 15,6.2 1.6x0.6
block metal 24,0.1 0.5x0.7
block wood 33,6.1 0.9x0.8
block metal 45,0.1 1.1x0.5
block wood 52,6.3 1.4x0.6
post concrete 20,1.2 0.2
post concrete 28,5.8 0.2
post concrete 40,1.1 0.2
route 2,3.5 78,3.5 78,4 2,4
";

fn simulate(log: &Path, place: &[&str], more: &[&str]) {
    let mut command = randt(&["simulate"]);
    command.args(place).args(more).arg("--out").arg(log);
    command.args(["--radar-mounting", "0.20,-0.10,3", "--radar-late", "30"]);
    let ended = ended_within(command, TIME_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}

fn calibrate(what: &str, log: &Path, more: &[&str]) -> Ended {
    let mut command = randt(&["calibrate", what]);
    command.arg(log).args(more);
    ended_within(command, TIME_MAX)
}

fn figures(what: &str, log: &Path) -> Value {
    let ended = calibrate(what, log, &["--json"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// A figure of a drive: name, error, sigma, and the largest error that is allowed.
type Figure = (&'static str, f64, f64, f64);

fn errors(log: &Path) -> Vec<Figure> {
    let time = figures("time", log);
    let mounting = figures("extrinsics", log);
    let (yaw, lever_arm) = (&mounting["yaw"], &mounting["lever_arm"]);
    let number = |value: &Value| value.as_f64().unwrap();
    for shown in [&time, yaw, lever_arm] {
        let spans = shown["shown_by"]["spans_s"].as_array().unwrap();
        assert!(!spans.is_empty());
        assert!(
            spans
                .iter()
                .all(|span| number(&span[0]) < number(&span[1]) && number(&span[1]) < 301.0)
        );
    }
    let error = |value: &Value, truth: f64| number(value) - truth;
    vec![
        (
            "late, ms",
            error(&time["radar_late_ms"], LATE_MS),
            number(&time["radar_late_sigma_ms"]),
            2.0,
        ),
        (
            "yaw, deg",
            error(&yaw["yaw_deg"], YAW_DEG),
            number(&yaw["sigma_deg"]),
            0.3,
        ),
        (
            "x, m",
            error(&lever_arm["x_m"], LEVER_ARM_M[0]),
            number(&lever_arm["x_sigma_m"]),
            0.03,
        ),
        (
            "y, m",
            error(&lever_arm["y_m"], LEVER_ARM_M[1]),
            number(&lever_arm["y_sigma_m"]),
            0.03,
        ),
    ]
}

/// Simulates and calibrates a drive, prints a row a figure, and holds each against its limit and
/// its sigmas.
fn check(folder: &Path, world: &str, seed: u64) -> PathBuf {
    let log = folder.join(format!("{world}-{seed}.mcap"));
    let more = ["--turns", "--scans", SCANS, "--seed", &seed.to_string()];
    simulate(&log, &[world], &more);
    let figures = errors(&log);
    for (name, error, sigma, _) in &figures {
        println!(
            "{world:<9} {seed}  {name:<9} error {error:+.4} sigma {sigma:.4} ratio {:+.2}",
            error / sigma
        );
    }
    for (name, error, sigma, limit) in figures {
        assert!(
            error.abs() < limit,
            "{world} {seed}: {name} is off by {error}"
        );
        assert!(
            error.abs() < 3.0 * sigma,
            "{world} {seed}: {name} is off by {error}, sigma {sigma}"
        );
        // A sigma without information would hold too.
        assert!(
            sigma < 0.7 * limit,
            "{world} {seed}: {name} has sigma {sigma}"
        );
    }
    log
}

#[test]
fn offset_yaw_and_lever_arm_are_found_on_three_drives() {
    let folder = tempfile::tempdir().unwrap();
    for (world, seed) in [("building", 1), ("yard", 2), ("tunnel", 3)] {
        fs::remove_file(check(folder.path(), world, seed)).unwrap();
    }
}

#[test]
#[ignore = "many minutes: the table of docs/calibrate.md"]
fn offset_yaw_and_lever_arm_are_found_on_nine_drives() {
    let folder = tempfile::tempdir().unwrap();
    for world in World::NAMES {
        for seed in 1..=3 {
            fs::remove_file(check(folder.path(), world, seed)).unwrap();
        }
    }
}

#[test]
fn a_straight_drive_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let world = folder.path().join("hall.world");
    fs::write(&world, STRAIGHT).unwrap();
    let log = folder.path().join("straight.mcap");
    let place = ["--world", world.to_str().unwrap()];
    simulate(&log, &place, &["--scans", "250"]);

    let time = calibrate("time", &log, &[]);
    assert_eq!(time.code, Some(1), "{}", time.stdout);
    assert!(
        time.stderr_contains("no time offset: the drive turns too little"),
        "{}",
        time.stderr
    );
    assert_eq!(time.stdout, "");

    let robot = folder.path().join("robot.toml");
    let written = ["--json", "--write", robot.to_str().unwrap()];
    let mounting = calibrate("extrinsics", &log, &written);
    assert_eq!(mounting.code, Some(1), "{}", mounting.stdout);
    assert!(
        mounting.stderr_contains("no lever arm: too little turning in place"),
        "{}",
        mounting.stderr
    );
    assert!(!mounting.stderr_contains("no yaw"), "{}", mounting.stderr);
    assert!(!robot.exists(), "half a calibration is not written");
    // What it did show is printed.
    let found: Value = serde_json::from_str(&mounting.stdout).unwrap();
    let yaw_deg = found["yaw"]["yaw_deg"].as_f64().unwrap();
    assert!((yaw_deg - YAW_DEG).abs() < 0.5, "{yaw_deg}");
    assert!(found["lever_arm"]["refused"].is_string());
}

#[test]
fn what_is_found_is_written_for_the_pipeline() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    simulate(&log, &["tunnel"], &["--turns", "--scans", "500"]);
    let robot = folder.path().join("robot.toml");
    let write = ["--write", robot.to_str().unwrap()];
    let ended = calibrate("extrinsics", &log, &write);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        ended.stdout.contains("in place to the left"),
        "{}",
        ended.stdout
    );

    let mut show = randt(&["config", "show", "--robot"]);
    show.arg(&robot);
    let shown = ended_within(show, TIME_MAX);
    assert_eq!(shown.code, Some(0), "{}", shown.stderr);
    let line = shown
        .stdout
        .lines()
        .find(|line| line.trim_start().starts_with("radar_x_m"))
        .unwrap();
    assert!(line.contains("0.2") || line.contains("0.19"), "{line}");

    // A file that is there stays, unless forced.
    let again = calibrate("extrinsics", &log, &write);
    assert_eq!(again.code, Some(1));
    assert!(again.stderr_contains("exists already"), "{}", again.stderr);
    let forced = calibrate("extrinsics", &log, &[&write[..], &["--force"]].concat());
    assert_eq!(forced.code, Some(0), "{}", forced.stderr);
}

#[test]
fn without_a_gyro_or_with_one_upside_down_there_is_no_offset() {
    let folder = tempfile::tempdir().unwrap();
    let events: Vec<Event> = Simulation::new(&World::building(), Robot::default(), 60, 1).collect();
    let log = folder.path().join("no-imu.mcap");
    let scans: Vec<Event> = events
        .iter()
        .filter(|event| !matches!(event, Event::Imu(_)))
        .cloned()
        .collect();
    drive::write(&scans, &log);
    let ended = calibrate("time", &log, &[]);
    assert_eq!(ended.code, Some(1));
    assert!(
        ended.stderr_contains("no IMU sample in it"),
        "{}",
        ended.stderr
    );

    let log = folder.path().join("upside-down.mcap");
    let mut turned = events;
    for event in &mut turned {
        if let Event::Imu(sample) = event {
            for axis in 1..3 {
                sample.rate_rad_s[axis] *= -1.0;
                sample.acceleration_m_s2[axis] *= -1.0;
            }
        }
    }
    drive::write(&turned, &log);
    let ended = calibrate("time", &log, &[]);
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr_contains("imu_roll_rad"), "{}", ended.stderr);
}

#[test]
fn the_offset_repairs_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (log, truth) = (at("late.mcap"), at("truth.tum"));
    let mut command = randt(&["simulate", "building", "--scans", "400"]);
    command.args(["--radar-late", "100"]).arg("--out").arg(&log);
    command.arg("--truth").arg(&truth);
    assert_eq!(ended_within(command, TIME_MAX).code, Some(0));
    let [as_it_is, corrected] = [
        ("as-it-is", 3, &["--no-loops"][..]),
        (
            "corrected",
            0,
            &["--no-loops", "--set", "odometry.radar_late_s=0.1"],
        ),
    ]
    .map(|(name, code, more)| {
        let ended = crate::support::run(&log, &at(name), more);
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        // What is not corrected is said, and set right to a centisecond or two.
        let figures = ["0.09", "0.10", "0.11"];
        let mut said = figures.iter().map(|late| format!("are {late} s late"));
        let is_late = said.any(|words| ended.stderr_contains(&words));
        assert_eq!(is_late, code == 3, "{}", ended.stderr);
        let figures = crate::support::figures(&at(name), "trajectory.tum", &truth);
        figures["ate_rmse_m"].as_f64().unwrap()
    });
    println!("ATE {as_it_is:.4} m as it is, {corrected:.4} m corrected");
    assert!(corrected < as_it_is, "{corrected} {as_it_is}");
}
