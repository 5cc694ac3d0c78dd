//! Missions: what begins when a robot starts, what goes on after a power cut, what is left when it is over.

use crate::support::journal::keyframes;
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::{Ended, ended, names, randt};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A robot: the folder of its missions.
struct Robot {
    root: tempfile::TempDir,
}

impl Robot {
    fn new() -> Self {
        Self {
            root: tempfile::tempdir().unwrap(),
        }
    }

    fn current(&self) -> PathBuf {
        self.root.path().join("current")
    }

    /// `randt mission ...`, without a pipeline.
    fn mission(&self, arguments: &[&str]) -> Ended {
        let mut command = randt(&["mission"]);
        command.args(arguments).arg("--root").arg(self.root.path());
        ended(command)
    }

    /// What systemd does at the start.
    fn boot(&self, pipeline: &Pipeline) -> String {
        let mut command = pipeline.command(&["mission", "boot"]);
        command.arg("--root").arg(self.root.path());
        let ended = ended(command);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        ended.stdout
    }

    /// The stages, and a drive.
    fn drive(&self, pipeline: &mut Pipeline, log: &Path) {
        pipeline.record(&self.current().join("logs"), &[]);
        pipeline.compute(&self.current());
        pipeline.play(log, &["--rate", "2", "--stay"]);
    }

    fn list(&self) -> Vec<(String, String)> {
        let list = self.mission(&["list", "--json"]);
        assert_eq!(list.code, Some(0), "{}", list.stderr);
        let rows: Value = serde_json::from_str(&list.stdout).unwrap();
        let text = |row: &Value, key: &str| row[key].as_str().unwrap().to_owned();
        let rows = rows.as_array().unwrap().iter();
        rows.map(|row| (text(row, "name"), text(row, "state")))
            .collect()
    }
}

fn name_in(said: &str) -> String {
    said.split(':').next().unwrap().to_owned()
}

#[test]
fn a_power_cut_interrupts_a_mission_and_a_stop_ends_it() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 120);
    let journal = robot.current().join("map.journal");
    let mut pipeline = Pipeline::new("m1");
    let said = robot.boot(&pipeline);
    assert!(said.ends_with("begins\n"), "{said}");
    let name = name_in(&said);
    robot.drive(&mut pipeline, &drive);
    until("keyframes", || keyframes(&journal).len() >= 12);
    // The power is cut: everybody at once, and the memory is lost.
    pipeline.kill_all();
    drop(pipeline);
    let before = keyframes(&journal);
    let logs = names(&robot.current().join("logs"));
    assert!(logs.iter().all(|log| log.ends_with(".active")), "{logs:?}");

    let mut pipeline = Pipeline::new("m2");
    let said = robot.boot(&pipeline);
    assert_eq!(said, format!("{name}: goes on\n"));
    robot.drive(&mut pipeline, &drive);
    // Whoever calls it in between disturbs nothing.
    assert!(robot.boot(&pipeline).contains("run already"));
    let mended = robot.mission(&["recover"]);
    assert_eq!(mended.code, Some(0), "{}", mended.stderr);
    for log in &logs {
        let whole = robot
            .current()
            .join("logs")
            .join(log.trim_end_matches(".active"));
        let mut check = randt(&["log", "check"]);
        check.arg(&whole);
        assert_eq!(ended(check).code, Some(0), "{whole:?}");
    }
    until("more keyframes", || {
        keyframes(&journal).len() >= before.len() + 5
    });
    let all = keyframes(&journal);
    assert_eq!(all[..before.len()], before);
    let frame = before.last().unwrap().1;
    assert!(all[before.len()..].iter().all(|(_, f)| *f > frame));
    // What has only just begun is a part by itself: nobody believes that it is in the map.
    let top = pipeline.randt(&["top", "--once", "--json"]);
    let figures: Value = serde_json::from_str(&top.stdout).unwrap();
    assert_eq!(figures["map"]["parts"], 2, "{figures}");
    pipeline.kill_all();

    let stopped = robot.mission(&["stop"]);
    assert_eq!(stopped.code, Some(0), "{}", stopped.stderr);
    assert_eq!(stopped.stderr, "");
    let report = robot.current().join("report");
    for file in ["report.json", "map.pgm", "trajectory.tum", "plot.svg"] {
        assert!(report.join(file).is_file(), "{file}: {}", stopped.stdout);
    }
    let text = fs::read_to_string(report.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["frames"].as_array().unwrap().len(), 2);
    assert_eq!(report["keyframes"], keyframes(&journal).len());
    let logs = names(&robot.current().join("logs"));
    assert!(logs.iter().all(|log| log.ends_with(".mcap")), "{logs:?}");

    // The next start is another drive.
    let pipeline = Pipeline::new("m3");
    let said = robot.boot(&pipeline);
    assert!(said.ends_with("begins\n"), "{said}");
    let next = name_in(&said);
    assert_eq!(
        robot.list(),
        [
            (name.clone(), "stopped".to_owned()),
            (next, "current".to_owned())
        ]
    );
    let out = robot.root.path().join("stick");
    fs::create_dir(&out).unwrap();
    let export = |name: &str| robot.mission(&["export", name, "--out", out.to_str().unwrap()]);
    let exported = export(&name);
    assert_eq!(exported.code, Some(0), "{}", exported.stderr);
    assert!(out.join(&name).join("report/map.pgm").is_file());
    assert_eq!(
        names(&out),
        std::slice::from_ref(&name),
        "nothing beside it"
    );
    let again = export(&name);
    assert_eq!(again.code, Some(1));
    assert!(again.stderr.contains("exists already"), "{}", again.stderr);
    let unknown = export("attic");
    assert!(unknown.stderr.contains(&name), "{}", unknown.stderr);
}

#[test]
fn a_new_mission_does_not_go_on_where_the_last_one_was() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 60);
    let mut pipeline = Pipeline::new("mn");
    robot.boot(&pipeline);
    robot.drive(&mut pipeline, &drive);
    let journal = robot.current().join("map.journal");
    until("keyframes", || keyframes(&journal).len() >= 3);
    pipeline.kill_all();
    let new = robot.mission(&["new", "cellar"]);
    assert_eq!(new.code, Some(0), "{}", new.stderr);
    assert!(new.stdout.ends_with("cellar: begins\n"), "{}", new.stdout);
    let taken = robot.mission(&["new", "cellar"]);
    assert!(taken.stderr.contains("exists already"), "{}", taken.stderr);
    // The same run folder, with all that odometry would go on from.
    assert_eq!(robot.boot(&pipeline), "cellar: goes on\n");
    robot.drive(&mut pipeline, &drive);
    std::thread::sleep(Duration::from_millis(100));
    let journal = robot.current().join("map.journal");
    until("keyframes", || keyframes(&journal).len() >= 3);
    assert_eq!(keyframes(&journal)[0].0, 0, "its own first keyframe");
}

#[test]
fn a_robot_without_missions_says_so() {
    let robot = Robot::new();
    let list = robot.mission(&["list"]);
    assert!(list.stdout.contains("no mission yet"), "{}", list.stdout);
    for arguments in [&["stop"] as &[&str], &["export", "--out", "x"]] {
        let ended = robot.mission(arguments);
        assert_eq!(ended.code, Some(1));
        assert!(
            ended.stderr.contains("there is no mission"),
            "{}",
            ended.stderr
        );
    }
    let mut command = randt(&["mission", "list", "--root", "/nowhere"]);
    command.stdin(std::process::Stdio::null());
    let nowhere = ended(command);
    assert_eq!(nowhere.code, Some(1));
    assert!(nowhere.stderr.contains("--root"), "{}", nowhere.stderr);
}
