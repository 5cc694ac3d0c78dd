//! Missions: what begins when a robot starts, what goes on after a power cut, what is left when it
//! is over.

mod robot;

use crate::support::journal::keyframes;
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::{OUTPUTS, ended, names, randt, report};
use robot::{Robot, name_in};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;

#[test]
fn a_power_cut_interrupts_a_mission_and_a_stop_ends_it() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 120);
    let journal = robot.current().join("map.journal");
    let mut pipeline = Pipeline::new("m1");
    let output = robot.boot(&pipeline);
    assert!(output.ends_with("begins\n"), "{output}");
    let name = name_in(&output);
    robot.drive(&mut pipeline, &drive);
    until("keyframes", || keyframes(&journal).len() >= 12);
    // The power is cut: everybody at once, and the memory is lost.
    pipeline.kill_all();
    drop(pipeline);
    let before = keyframes(&journal);
    let logs = names(&robot.current().join("logs"));
    assert!(logs.iter().all(|log| log.ends_with(".active")), "{logs:?}");

    let mut pipeline = Pipeline::new("m2");
    let output = robot.boot(&pipeline);
    assert_eq!(output, format!("{name}: goes on\n"));
    robot.drive(&mut pipeline, &drive);
    // A call in between disturbs nothing.
    assert!(robot.boot(&pipeline).contains("run already"));
    let repaired = robot.mission(&["recover"]);
    assert_eq!(repaired.code, Some(0), "{}", repaired.stderr);
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
    assert_eq!(figures["map"]["components"], 2, "{figures}");
    pipeline.kill_all();

    let stopped = robot.stop(&pipeline);
    assert_eq!(stopped.code, Some(3), "{}", stopped.stderr);
    assert!(
        stopped.stderr_contains("power_cuts 1 "),
        "{}",
        stopped.stderr
    );
    let report = robot.current().join("report");
    for file in ["report.json", "map.pgm", "trajectory.tum", "plot.svg"] {
        assert!(report.join(file).is_file(), "{file}: {}", stopped.stdout);
    }
    let text = fs::read_to_string(report.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["frames"].as_array().unwrap().len(), 2);
    // Those of the window, too.
    let mapped = report["keyframes"].as_u64().unwrap() as usize;
    assert!(mapped > keyframes(&journal).len(), "{mapped}");
    let logs = names(&robot.current().join("logs"));
    assert!(logs.iter().all(|log| log.ends_with(".mcap")), "{logs:?}");

    // The next start is another drive.
    let pipeline = Pipeline::new("m3");
    let output = robot.boot(&pipeline);
    assert!(
        output.ends_with(&format!("begins: {name} was stopped\n")),
        "{output}"
    );
    let next = name_in(&output);
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
    let mut new = pipeline.command(&["mission", "new", "cellar"]);
    new.arg("--root").arg(robot.root.path());
    let new = ended(new);
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
fn a_robot_without_missions_is_reported_as_one() {
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

/// Waits until the drive was played and computed to its end.
fn until_driven(pipeline: &Pipeline, journal: &Path) {
    let mut keyframes_before = 0;
    let mut quiet = 0;
    // 60 scans take 6 s; then nothing comes any more.
    std::thread::sleep(Duration::from_secs(6));
    until("the end of the drive", || {
        std::thread::sleep(Duration::from_millis(200));
        let now = keyframes(journal).len();
        quiet = if now == keyframes_before {
            quiet + 1
        } else {
            0
        };
        keyframes_before = now;
        quiet > 5
    });
    let all = randt_stage::Registry::all(pipeline.domain());
    assert!(all.iter().all(|(_, lives)| *lives), "{all:?}");
}

/// What a report has about the drive, not about how it was computed.
const LISTED: [&str; 9] = [
    "scans",
    "keyframes",
    "path_m",
    "frames",
    "trust",
    "loops",
    "accuracy",
    "configuration",
    "trajectory_sha256",
];

/// A mission's report is that of `randt run` on its log, file by file.
fn is_as_computed(found: &Path, expected: &Path) {
    for name in [
        "odometry.csv",
        "odometry.tum",
        "trajectory.tum",
        "keyframes.tum",
        "map.pgm",
        "map.yaml",
    ] {
        let [found, expected] =
            [found, expected].map(|folder| fs::read(folder.join(name)).unwrap());
        let differs = found.iter().zip(&expected).position(|(a, b)| a != b);
        assert!(found == expected, "{name}: differs at byte {differs:?}");
    }
    let [found, expected] = [found, expected].map(report);
    for key in LISTED {
        assert_eq!(found[key], expected[key], "{key}");
    }
    assert!(expected["keyframes"].as_u64().unwrap() > 5);
}

#[test]
fn a_missions_report_is_what_its_log_gives() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 60);
    let mut pipeline = Pipeline::new("meq");
    robot.boot(&pipeline);
    robot.drive(&mut pipeline, &drive);
    until_driven(&pipeline, &robot.current().join("map.journal"));
    // It ends the stages, too: nobody else has started them.
    let stopped = robot.stop(&pipeline);
    assert_eq!(stopped.code, Some(0), "{}", stopped.stderr);
    let all = randt_stage::Registry::all(pipeline.domain());
    assert!(
        all.iter().all(|(entry, lives)| !lives && entry.ended),
        "{all:?}"
    );
    is_as_computed(&robot.current().join("report"), &robot.run());
    assert_eq!(names(&robot.current().join("report")), OUTPUTS);

    // Without odometry's state and the report it is made of the logs alone, by the command that
    // exports it.
    fs::remove_dir_all(robot.current().join("report")).unwrap();
    let out = robot.root.path().join("stick");
    let exported = robot.mission(&["export", "--out", out.to_str().unwrap()]);
    assert_eq!(exported.code, Some(0), "{}", exported.stderr);
    let name = names(&out).pop().unwrap();
    is_as_computed(
        &out.join(name).join("report"),
        &robot.root.path().join("run"),
    );
}

#[test]
fn a_mission_whose_memory_is_gone_is_computed_from_its_log() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 60);
    let journal = robot.current().join("map.journal");
    // The machine was shut down, and the mission is stopped behind its next start.
    let mut pipeline = Pipeline::new("mshut");
    robot.boot(&pipeline);
    robot.drive(&mut pipeline, &drive);
    until("keyframes", || keyframes(&journal).len() >= 8);
    pipeline.end_all();
    drop(pipeline);
    let stopped = robot.mission(&["stop"]);
    assert_eq!(stopped.code, Some(0), "{}", stopped.stderr);
    is_as_computed(&robot.current().join("report"), &robot.run());

    // The power was cut: the map is on the disk sooner than the log, and what odometry had beyond
    // that is gone.
    let mut pipeline = Pipeline::new("mcut");
    robot.boot(&pipeline);
    robot.drive(&mut pipeline, &drive);
    until("keyframes", || keyframes(&journal).len() >= 8);
    pipeline.kill_all();
    drop(pipeline);
    let stopped = robot.mission(&["stop"]);
    let report = report(&robot.current().join("report"));
    let mapped = report["keyframes"].as_u64().unwrap() as usize;
    assert!(mapped >= keyframes(&journal).len(), "{report}");
    // By chance the log has it all.
    if stopped.code != Some(0) {
        assert_eq!(stopped.code, Some(3), "{}", stopped.stderr);
        assert!(
            stopped.stderr_contains("window_lost 1 (first: the logs end"),
            "{}",
            stopped.stderr
        );
    }
}

#[test]
fn a_mission_is_not_stopped_while_somebody_writes_into_it() {
    let robot = Robot::new();
    let mut pipeline = Pipeline::new("mother");
    let output = robot.boot(&pipeline);
    pipeline.compute(&robot.current());
    let states = |robot: &Robot| robot.list().remove(0).1;
    // Another run folder: these stages are not that pipeline's.
    let elsewhere = Pipeline::new("melse");
    let refused = robot.stop(&elsewhere);
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(
        refused.stderr_contains("still writes its map"),
        "{}",
        refused.stderr
    );
    assert_eq!(states(&robot), "current");
    let all = randt_stage::Registry::all(pipeline.domain());
    assert!(all.iter().all(|(_, lives)| *lives), "{all:?}");
    // Two at once: one of them stops it.
    let (one, two) = std::thread::scope(|scope| {
        let other = scope.spawn(|| robot.stop(&pipeline));
        (robot.stop(&pipeline), other.join().unwrap())
    });
    let both = [&one, &two];
    assert!(both.iter().all(|it| it.code == Some(0)), "{both:?}");
    let how = |words: &str| both.iter().filter(|it| it.stdout.contains(words)).count();
    assert_eq!(
        (how("is stopped"), how("was stopped before")),
        (1, 1),
        "{both:?}"
    );
    assert_eq!(robot.list(), [(name_in(&output), "stopped".to_owned())]);
    let all = randt_stage::Registry::all(pipeline.domain());
    assert!(all.iter().all(|(_, lives)| !lives), "{all:?}");
}

#[test]
fn a_mission_whose_record_is_broken_is_listed_repaired_and_exported() {
    let robot = Robot::new();
    let drive = log(robot.root.path(), 10);
    let pipeline = Pipeline::new("mbroken");
    let name = name_in(&robot.boot(&pipeline));
    let folder = robot.root.path().join("missions").join(&name);
    fs::write(folder.join("mission.json"), "{\"randt\": \"0.1").unwrap();
    let bytes = fs::read(&drive).unwrap();
    let cut = folder.join("logs/2026-11-29T10-00-00Z.mcap.cut");
    fs::write(&cut, &bytes[..bytes.len() * 3 / 4]).unwrap();
    assert_eq!(robot.list(), [(name.clone(), "broken".to_owned())]);
    let list = robot.mission(&["list"]);
    assert!(
        list.stdout.contains("broken: mission.json"),
        "{}",
        list.stdout
    );
    let out = robot.root.path().join("stick");
    let exported = robot.mission(&["export", "--out", out.to_str().unwrap()]);
    assert!(
        exported.code.is_some_and(|code| code != 1),
        "{}",
        exported.stderr
    );
    let whole = "logs/2026-11-29T10-00-00Z.mcap";
    assert!(out.join(&name).join(whole).is_file());
    let repaired = robot.mission(&["recover"]);
    assert_eq!(repaired.code, Some(0), "{}", repaired.stderr);
    assert!(
        repaired.stderr_contains("written anew"),
        "{}",
        repaired.stderr
    );
    assert!(folder.join(whole).is_file() && !cut.exists());
    assert_eq!(robot.list(), [(name.clone(), "current".to_owned())]);
    // The link leads nowhere: the robot can drive all the same.
    fs::rename(&folder, robot.root.path().join("missions/moved")).unwrap();
    let stopped = robot.mission(&["stop"]);
    assert_eq!(stopped.code, Some(1));
    assert!(
        stopped.stderr_contains("leads to no mission"),
        "{}",
        stopped.stderr
    );
    let output = robot.boot(&pipeline);
    assert!(output.ends_with(": begins\n"), "{output}");
    assert_eq!(robot.list().len(), 2);
}
