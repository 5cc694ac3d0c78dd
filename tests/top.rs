//! `randt top` on running stages: its figures, its words for what becomes of a stage, and that it
//! disturbs nobody.

use crate::support::pipeline::{Pipeline, log, signal};
use randt_messages::{ImuSample, OdometryStateTopic, Topic};
use randt_stage::Stage;
use rustix::process::Signal;
use serde_json::Value;
use std::time::Duration;

const ONCE: [&str; 3] = ["top", "--once", "--json"];

/// The figures of `randt top --once --json`.
fn figures(pipeline: &Pipeline) -> Value {
    let ended = pipeline.randt(&ONCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// The row of a stage or topic.
fn row<'a>(figures: &'a Value, table: &str, name: &str) -> &'a Value {
    let rows = figures[table].as_array().unwrap();
    let found = rows.iter().find(|row| row["name"] == name);
    found.unwrap_or_else(|| panic!("no {name} in {figures}"))
}

fn assert_rate(figures: &Value, topic: &str, expected_hz: f64) {
    let row = row(figures, "topics", topic);
    let rate_hz = row["rate_hz"].as_f64().unwrap();
    // On a busy machine a message more or less falls into the second that is counted, and the last
    // one is older.
    assert!((rate_hz / expected_hz - 1.0).abs() < 0.3, "{row}");
    assert!(row["age_s"].as_f64().unwrap() < 5.0, "{row}");
    assert_eq!(row["lost"], 0, "{row}");
}

#[test]
fn stages_and_topics_are_shown_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    let mut pipeline = Pipeline::new("top");
    let filter = pipeline.stage("filter");
    let play = pipeline.play(&log, &["--loop"]);
    let now = figures(&pipeline);
    for (name, pid) in [("filter", filter), ("play", play)] {
        let stage = row(&now, "stages", name);
        assert_eq!(stage["state"], "running", "{stage}");
        assert_eq!(
            (&stage["pid"], &stage["restarts"]),
            (&pid.into(), &0.into()),
            "{stage}"
        );
        assert!(
            stage["epoch"].as_u64().unwrap() > 1_000_000_000_000_000_000,
            "{stage}"
        );
        assert!(
            (0.0..50.0).contains(&stage["cpu_percent"].as_f64().unwrap()),
            "{stage}"
        );
        assert!(
            (1e6..1e9).contains(&stage["rss_bytes"].as_f64().unwrap()),
            "{stage}"
        );
    }
    assert_rate(&now, "radar/scan/v1", 5.0);
    assert_rate(&now, "radar/points/v1", 5.0);
    assert_rate(&now, "imu/sample/v1", 250.0);
    for part in ["wait_p50", "wait_p99", "compute_p50", "compute_p99"] {
        assert!(
            now["latency_ms"][part].is_null(),
            "no odometry, no latency: {now}"
        );
    }

    let text = pipeline.randt(&["top", "--once"]);
    assert_eq!(text.code, Some(0));
    for words in [
        "STAGE",
        "running",
        "radar/scan/v1",
        " Hz",
        "MB",
        "compute    -",
    ] {
        assert!(text.stdout.contains(words), "{words}: {}", text.stdout);
    }
    assert!(!text.stdout.contains('\x1b'), "no control of a terminal");

    signal(filter, Signal::STOP);
    assert_eq!(
        row(&figures(&pipeline), "stages", "filter")["state"],
        "stopped"
    );
    signal(filter, Signal::CONT);
    assert_eq!(
        row(&figures(&pipeline), "stages", "filter")["state"],
        "running"
    );

    pipeline.end(filter, Signal::KILL);
    let dead = figures(&pipeline);
    let stage = row(&dead, "stages", "filter");
    assert_eq!(
        (&stage["state"], &stage["pid"]),
        (&"dead".into(), &filter.into())
    );
    assert!(
        stage["cpu_percent"].is_null() && stage["rss_bytes"].is_null(),
        "{stage}"
    );

    let again = pipeline.stage("filter");
    // It begins with what is in reach, all at once; rates are those of three seconds.
    std::thread::sleep(Duration::from_secs(3));
    let back = figures(&pipeline);
    let stage = row(&back, "stages", "filter");
    assert_eq!(
        (&stage["state"], &stage["pid"]),
        (&"running".into(), &again.into())
    );
    assert_eq!(stage["restarts"], 1);
    assert_rate(&back, "radar/points/v1", 5.0);

    pipeline.end(play, Signal::TERM);
    let ended = figures(&pipeline);
    assert_eq!(
        row(&ended, "stages", "play")["state"],
        "finished",
        "{ended}"
    );
}

#[test]
fn the_pipeline_has_latency_pose_and_map() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let mut pipeline = Pipeline::new("whole");
    let journal = folder.path().join("journal");
    let mut mapper = std::process::Command::new(crate::support::stages::program("mapper"));
    pipeline.enter(&mut mapper);
    mapper.arg("--journal").arg(journal);
    pipeline.start("mapper", mapper);
    pipeline.stage("odometry");
    pipeline.stage("filter");
    pipeline.play(&log, &["--loop"]);
    // Keyframes leave the window after some metres.
    std::thread::sleep(Duration::from_secs(6));
    let now = figures(&pipeline);
    assert_rate(&now, "odometry/state/v1", 5.0);
    for part in ["wait_p50", "wait_p99", "compute_p50", "compute_p99"] {
        let ms = now["latency_ms"][part].as_f64().unwrap();
        assert!((0.0..10_000.0).contains(&ms), "{part}: {now}");
    }
    assert_eq!(now["robot"]["trust"], "good", "{now}");
    assert!(now["robot"]["velocity"][0].as_f64().unwrap() > 0.0, "{now}");
    assert!(now["map"]["keyframes"].as_u64().unwrap() > 0, "{now}");
    assert_eq!(now["map"]["components"], 1, "{now}");
}

#[test]
fn many_watch_at_once_and_nobody_loses_anything() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    let mut pipeline = Pipeline::new("many");
    let filter = pipeline.stage("filter");
    pipeline.play(&log, &["--loop"]);
    let pipeline = &pipeline;
    std::thread::scope(|scope| {
        let looks: Vec<_> = (0..6).map(|_| scope.spawn(|| figures(pipeline))).collect();
        for look in looks {
            let now = look.join().unwrap();
            assert_rate(&now, "radar/points/v1", 5.0);
            assert_rate(&now, "imu/sample/v1", 250.0);
            let notes = now["notes"].as_array().unwrap();
            assert!(notes.is_empty(), "{now}");
        }
    });
    // The one who looks is in no register, and is not missed.
    let now = figures(pipeline);
    assert_eq!(now["stages"].as_array().unwrap().len(), 2, "{now}");
    assert_eq!(row(&now, "stages", "filter")["pid"], filter);
}

#[test]
fn in_an_empty_domain_it_names_the_folder_and_leaves_nothing() {
    let pipeline = Pipeline::new("none");
    let ended = pipeline.randt(&ONCE);
    assert_eq!(ended.code, Some(1));
    let folder = pipeline.domain().folder();
    assert!(
        ended.stderr_contains("no pipeline is there"),
        "{}",
        ended.stderr
    );
    assert!(
        ended.stderr_contains(&folder.display().to_string()),
        "{}",
        ended.stderr
    );
    assert!(!folder.exists() && pipeline.segments().is_empty());

    let ended = pipeline.randt(&["top"]);
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr_contains("no terminal"), "{}", ended.stderr);
    assert_eq!(pipeline.randt(&["top", "--json"]).code, Some(2));
    assert_eq!(pipeline.randt(&["top", "--interval", "0"]).code, Some(2));
}

/// States as another build has them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OtherStates;

impl Topic for OtherStates {
    const NAME: &'static str = OdometryStateTopic::NAME;
    const TYPE_NAME: &'static str = "OdometryStateTopic-0123456789abcdef";
    const MAX_ITEMS: usize = 0;
    type Head = ImuSample;
    type Item = ();
}

#[test]
fn a_topic_of_another_build_is_reported_and_the_rest_is_shown() {
    let mut pipeline = Pipeline::new("other");
    // This process is a stage of another build.
    let mut stage = Stage::open("odd", pipeline.domain()).unwrap();
    let _states = stage.publisher::<OtherStates>().unwrap();
    stage.running().unwrap();
    pipeline.stage("filter");
    let now = figures(&pipeline);
    assert_eq!(row(&now, "stages", "filter")["state"], "running");
    assert_eq!(row(&now, "stages", "odd")["pid"], std::process::id());
    let notes = now["notes"].to_string();
    assert!(
        notes.contains("odometry/state/v1 is not read: randt-odd"),
        "{notes}"
    );
    stage.close().unwrap();
}
