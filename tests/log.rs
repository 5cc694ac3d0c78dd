//! `randt log`: what it prints of logs, what it finds wrong, and that what it writes reads back.

use crate::support::pipeline::log;
use crate::support::python::{read_rerun, read_ros2};
use crate::support::{Ended, ended, names, randt, run};
use randt_log::{LogFile, ROBOT_METADATA, Robot};
use randt_messages::{ImuSample, ImuSampleTopic, Message, RadarScan};
use randt_readers::{Event, Options, Source};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn log_command(action: &str, file: &Path, more: &[&str]) -> Ended {
    let mut command = randt(&["log", action]);
    command.arg(file).args(more);
    ended(command)
}

fn info(file: &Path) -> Value {
    let ended = log_command("info", file, &["--json"]);
    let info: Value = serde_json::from_str(&ended.stdout).unwrap();
    // 3 where messages were not recorded.
    let is_whole = info["missing"].as_array().unwrap().is_empty();
    let code = if is_whole { 0 } else { 3 };
    assert_eq!(ended.code, Some(code), "{}", ended.stderr);
    info
}

/// All scans and samples of a recording of any format.
fn content(path: &Path) -> (Vec<Message<RadarScan>>, Vec<ImuSample>, Box<dyn Source>) {
    let mut source = randt_readers::open(path, &Options::default()).unwrap();
    let (mut scans, mut samples) = (Vec::new(), Vec::new());
    while let Some(event) = source.next_event().unwrap() {
        match event {
            Event::Scan(scan) => scans.push(scan),
            Event::Imu(sample) => samples.push(sample),
            Event::Twist(_) | Event::Truth(_) => {}
        }
    }
    (scans, samples, source)
}

#[test]
fn bags_of_both_kinds_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 30);
    let (scans, samples, original) = content(&input);
    for (format, name) in [("ros1", "drive.bag"), ("ros2", "drive")] {
        let bag = folder.path().join(name);
        let out = bag.display().to_string();
        let ended = log_command("export", &input, &["--to", format, "--out", &out]);
        assert_eq!(ended.code, Some(0), "{format}: {}", ended.stderr);
        let again = log_command("export", &input, &["--to", format, "--out", &out]);
        assert_eq!(
            again.code,
            Some(1),
            "{format}: nothing is overwritten silently"
        );
        let (bag_scans, bag_samples, source) = content(&bag);
        // A return at range 0 has no direction, so no point either.
        let counters = source.counters();
        assert!(
            counters.iter().all(|counter| !counter.loss),
            "{format}: {counters:?}"
        );
        assert_eq!(source.info().sensor, original.info().sensor, "{format}");
        // A mounting goes through sines and back.
        let (found, expected) = (source.info().extrinsics, original.info().extrinsics);
        let off = found
            .radar
            .unwrap()
            .between(&expected.radar.unwrap_or_default());
        assert!(
            off.translation().norm() < 1e-9 && off.yaw_rad.abs() < 1e-9,
            "{format}"
        );
        assert_eq!(bag_samples.len(), samples.len(), "{format}");
        for (bag, original) in bag_samples.iter().zip(&samples) {
            assert_eq!(bag.header.stamp_ns, original.header.stamp_ns);
            assert_eq!(bag.rate_rad_s, original.rate_rad_s);
            assert_eq!(bag.acceleration_m_s2, original.acceleration_m_s2);
        }
        assert_eq!(bag_scans.len(), scans.len(), "{format}");
        for (bag, original) in bag_scans.iter().zip(&scans) {
            assert_eq!(bag.head.header.stamp_ns, original.head.header.stamp_ns);
            let original = original.items.iter().filter(|point| point.range_m > 0.0);
            assert_eq!(bag.items.len(), original.clone().count(), "{format}");
            for (a, b) in bag.items.iter().zip(original) {
                assert!((a.range_m - b.range_m).abs() < 1e-4, "{a:?} {b:?}");
                assert_eq!(a.intensity, b.intensity);
            }
        }
        let computed = run(&bag, &folder.path().join(format!("run-{format}")), &[]);
        assert_eq!(computed.code, Some(0), "{format}: {}", computed.stderr);
    }
}

#[test]
fn others_read_our_logs_and_bags() {
    let folder = tempfile::tempdir().unwrap();
    // Every topic, each field with a value of its own.
    let kept =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/log/tests/fixtures/layouts-5.mcap");
    let tables = folder.path().join("tables");
    let out = tables.display().to_string();
    let more = ["--to", "csv", "--items", "--out", &out];
    let ended = log_command("export", &kept, &more);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    read_ros2(std::slice::from_ref(&kept), Some(&tables));
    read_rerun(&[kept]);

    let input = folder.path().join("run.mcap");
    crate::support::recorded::write(60, &input);
    let mut files = vec![input.clone()];
    for (format, name) in [("ros1", "run.bag"), ("ros2", "run")] {
        let bag = folder.path().join(name);
        let out = bag.display().to_string();
        let ended = log_command("export", &input, &["--to", format, "--out", &out]);
        assert_eq!(ended.code, Some(0), "{format}: {}", ended.stderr);
        files.push(bag);
    }
    read_ros2(&files, None);
}

#[test]
fn tables_and_trajectories_have_every_message() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 20);
    let topics = info(&input)["topics"].clone();
    let messages = |topic: &str| topics[topic]["messages"].as_u64().unwrap() as usize;
    let ended = log_command("export", &input, &["--to", "csv", "--items"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let tables = input.with_extension("csv");
    let lines = |name: &str| {
        fs::read_to_string(tables.join(name))
            .unwrap()
            .lines()
            .count()
            - 1
    };
    assert_eq!(lines("imu_sample_v1.csv"), messages("imu/sample/v1"));
    assert_eq!(lines("radar_scan_v1.csv"), 20);
    let (scans, ..) = content(&input);
    let returns: usize = scans.iter().map(|scan| scan.items.len()).sum();
    assert_eq!(lines("radar_scan_v1.items.csv"), returns);
    let ended = log_command("export", &input, &["--to", "tum"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let folder = input.with_extension("tum");
    assert_eq!(
        names(&folder),
        ["truth.tum"],
        "a simulated log has the truth alone"
    );
    assert_eq!(
        crate::support::tum(&folder.join("truth.tum")).len(),
        messages("truth/pose/v1")
    );
}

#[test]
fn a_cut_log_has_its_span_and_a_damaged_one_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 25);
    let part = folder.path().join("part.mcap");
    let out = part.display().to_string();
    let span = ["--from", "1", "--to", "3", "--out", &out];
    let ended = log_command("cut", &input, &span);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found = info(&part);
    assert_eq!(found["metadata"], info(&input)["metadata"]);
    let samples = found["topics"]["imu/sample/v1"]["messages"]
        .as_u64()
        .unwrap();
    assert!((495..=505).contains(&samples), "{samples}");
    assert_eq!(log_command("cut", &input, &span).code, Some(1), "it exists");

    assert_eq!(log_command("check", &part, &[]).code, Some(0));
    let mut bytes = fs::read(&part).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = folder.path().join("damaged.mcap");
    fs::write(&damaged, &bytes).unwrap();
    let checked = log_command("check", &damaged, &[]);
    assert_eq!(checked.code, Some(3), "{}", checked.stdout);
    assert!(checked.stdout.contains("damaged"), "{}", checked.stdout);
    // Half a file, as a copy that was broken off leaves it.
    let bytes = fs::read(&input).unwrap();
    fs::write(&damaged, &bytes[..bytes.len() / 2]).unwrap();
    assert_eq!(log_command("check", &damaged, &[]).code, Some(3));
    let recovered = log_command("recover", &damaged, &[]);
    assert_eq!(recovered.code, Some(0), "{}", recovered.stderr);
    let whole = folder.path().join("damaged.recovered.mcap");
    assert_eq!(log_command("check", &whole, &[]).code, Some(0));
    let text = log_command("info", &whole, &[]).stdout;
    assert!(
        text.contains("radar/scan/v1") && text.contains("randt/robot"),
        "{text}"
    );
}

/// What Python finds in a file for viewers, by the official schemas: topics with their messages.
fn views(file: &Path) -> Vec<(String, u64)> {
    let topics = info(file)["topics"].as_object().unwrap().clone();
    assert!(topics.values().all(|topic| topic["encoding"] == "protobuf"));
    let messages = |topic: &Value| topic["messages"].as_u64().unwrap();
    let topics = topics.iter();
    topics
        .map(|(name, topic)| (name.clone(), messages(topic)))
        .collect()
}

#[test]
fn viewers_get_what_the_recorder_leaves_out() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("run.mcap");
    crate::support::recorded::write(120, &input);
    let out = folder.path().join("run.foxglove.mcap");
    let ended = log_command("export", &input, &["--foxglove"]);
    assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""));
    let topics = info(&input)["topics"].clone();
    let found = views(&out);
    let of = |name: &str| {
        found
            .iter()
            .find(|(topic, _)| topic == name)
            .map_or(0, |t| t.1)
    };
    let messages = |topic: &str| topics[topic]["messages"].as_u64().unwrap();
    assert_eq!((of("view/scan"), of("view/points")), (120, 120));
    assert_eq!(of("view/pose"), messages("odometry/state/v1"));
    assert_eq!(of("view/transforms"), messages("odometry/state/v1") + 1);
    assert_eq!(of("view/cells"), messages("odometry/keyframe/v1"));
    assert!(of("view/graph") > 1 && of("view/loops") > 1 && of("view/grid") > 1);
    assert_eq!(of("view/missing"), 1);
    crate::support::python::read_logs(std::slice::from_ref(&out));

    // The same by its other name, and nothing is overwritten silently: not even the log itself.
    let again = log_command("export", &input, &["--to", "foxglove"]);
    assert_eq!(again.code, Some(1), "{}", again.stdout);
    let itself = input.display().to_string();
    let on_itself = log_command(
        "export",
        &input,
        &["--foxglove", "--force", "--out", &itself],
    );
    assert!(
        on_itself.stderr_contains("is the log itself"),
        "{}",
        on_itself.stderr
    );
    let forced = log_command("export", &input, &["--to", "foxglove", "--force"]);
    assert_eq!(forced.code, Some(0), "{}", forced.stderr);
    assert_eq!(names(folder.path()), ["run.foxglove.mcap", "run.mcap"]);

    // As a kill leaves it: up to the cut.
    let cut = folder.path().join("cut.mcap.active");
    let bytes = fs::read(&input).unwrap();
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let out = folder.path().join("cut.foxglove.mcap");
    let shown = out.display().to_string();
    let ended = log_command("export", &cut, &["--foxglove", "--out", &shown]);
    assert_eq!(ended.code, Some(3), "{}", ended.stderr);
    assert!(ended.stderr_contains("stepped over"), "{}", ended.stderr);
    assert!(
        views(&out)
            .iter()
            .any(|(topic, count)| topic == "view/cells" && *count > 0)
    );
}

#[test]
fn what_viewers_cannot_be_shown_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 10);
    let ended = log_command("export", &input, &["--foxglove"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    for words in [
        "the log has no odometry/state/v1: pose and transforms are not shown",
        "the log has no odometry/keyframe/v1: NDT cells are not shown",
        "the log has no mapper/graph/v1: the pose graph is not shown",
        "the log has no mapper/grid/v1: the occupancy grid is not shown",
    ] {
        assert!(ended.stderr_contains(words), "{words}: {}", ended.stderr);
    }
    let found = views(&input.with_extension("foxglove.mcap"));
    let found: Vec<_> = found
        .iter()
        .map(|(name, count)| (name.as_str(), *count))
        .collect();
    assert_eq!(found, [("view/scan", 10), ("view/transforms", 1)]);

    let empty = folder.path().join("empty.mcap");
    let log = LogFile::create(&empty, randt_log::Options::default()).unwrap();
    log.finish().unwrap();
    let ended = log_command("export", &empty, &["--foxglove"]);
    assert_eq!(ended.code, Some(1));
    assert!(
        ended.stderr_contains("nothing that a viewer could show"),
        "{}",
        ended.stderr
    );
    let none = folder.path().join("none.mcap");
    fs::write(&none, "# stamp x y z\n").unwrap();
    let ended = log_command("export", &none, &["--foxglove"]);
    assert!(
        ended.stderr_contains("not an MCAP file"),
        "{}",
        ended.stderr
    );
    let left = names(folder.path());
    assert!(!left.iter().any(|name| name.ends_with(".part")), "{left:?}");
}

#[test]
fn a_robot_that_is_named_behind_the_messages_is_not_passed_over_in_silence() {
    let folder = tempfile::tempdir().unwrap();
    let late = folder.path().join("late.mcap");
    let (scans, samples, _) = content(&log(folder.path(), 10));
    let mut file = LogFile::create(&late, randt_log::Options::default()).unwrap();
    for sample in samples {
        let sample = Message::<ImuSampleTopic> {
            head: Box::new(sample),
            items: Vec::new(),
        };
        file.write(sample.as_ref()).unwrap();
    }
    for scan in &scans {
        file.write(scan.as_ref()).unwrap();
    }
    let robot = Robot {
        radar: Some([0.12, 0.0, 0.0]),
        ..Robot::default()
    };
    file.write_metadata(ROBOT_METADATA, robot.to_metadata())
        .unwrap();
    file.finish().unwrap();
    let computed = run(&late, &folder.path().join("run"), &[]);
    assert_eq!(computed.code, Some(3), "{}", computed.stderr);
    assert!(
        computed.stderr.contains("behind the first message"),
        "{}",
        computed.stderr
    );
}

#[test]
fn a_span_that_ends_before_it_begins_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 5);
    let out = folder.path().join("part.mcap");
    let out = out.to_str().unwrap();
    let cut = log_command("cut", &input, &["--from", "50", "--to", "20", "--out", out]);
    assert_eq!(cut.code, Some(2), "{}", cut.stderr);
    assert!(
        cut.stderr.contains("--from is after --to"),
        "{}",
        cut.stderr
    );
    assert!(!Path::new(out).exists());
}
