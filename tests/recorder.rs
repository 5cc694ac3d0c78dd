//! `randt-recorder` as a process: what it records of a running pipeline, what it leaves when it is
//! killed, what it does when its folder is gone, and that all of it can be read and computed
//! again.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::python::{read_rerun, read_ros2};
use crate::support::{Random, ended, names, randt, remove_folder, run};
use randt_log::LogReader;
use randt_messages::{ImuSampleTopic, RadarScan, Topic};
use randt_stage::Clock;
use rustix::process::Signal;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// What `randt log info` prints.
fn info(file: &Path) -> Value {
    let mut command = randt(&["log", "info", "--json"]);
    command.arg(file);
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// The recorder's status: state and message.
fn state(pipeline: &Pipeline) -> (String, String) {
    let ended = pipeline.randt(&["top", "--once", "--json"]);
    let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
    let stages = figures["stages"].as_array().unwrap();
    let recorder = stages.iter().find(|stage| stage["name"] == "recorder");
    let text = |key: &str| recorder.unwrap()[key].as_str().unwrap_or("").to_owned();
    (text("state"), text("message"))
}

/// Logs in a folder, finished or not, in the order of time.
fn logs(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = names(folder).iter().map(|name| folder.join(name)).collect();
    // Of one second: NAME, NAME-1, NAME-2 ...
    files.sort_by_key(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let stem = name.split('.').next().unwrap().to_owned();
        let (date, number) = stem
            .split_once("Z-")
            .unwrap_or((stem.trim_end_matches('Z'), "0"));
        (date.to_owned(), number.parse::<u32>().unwrap())
    });
    files
}

/// Scans and samples of a file's whole chunks: epoch and number, with when they were published.
///
/// A file without a byte holds none: a kill may fall between its name and its first bytes.
fn published(file: &Path) -> BTreeMap<(&'static str, u64, u64), i64> {
    let mut found = BTreeMap::new();
    if fs::metadata(file).unwrap().len() == 0 {
        return found;
    }
    let mut reader = LogReader::open(file).unwrap();
    reader.whole_chunks_only();
    while let Some(entry) = reader.next_entry().unwrap() {
        let (topic, header) = if let Some(scan) = entry.decode::<RadarScan>().unwrap() {
            (RadarScan::NAME, scan.head.header)
        } else if let Some(sample) = entry.decode::<ImuSampleTopic>().unwrap() {
            (ImuSampleTopic::NAME, sample.head.header)
        } else {
            continue;
        };
        found.insert((topic, header.epoch, header.sequence), header.published_ns);
    }
    found
}

#[test]
fn a_run_is_recorded_whole_and_computes_again() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 50);
    let out = folder.path().join("logs");
    let mut pipeline = Pipeline::new("rr");
    // The recorder first, as on a robot.
    let set = ["--set", "record.file_max_s=9"];
    let recorder = pipeline.record(&out, &set);
    pipeline.compute(folder.path());
    let play = pipeline.play(&input, &["--stay"]);
    // Ten seconds of drive, and a moment for the rest.
    std::thread::sleep(Duration::from_secs(12));
    pipeline.end(recorder, Signal::TERM);
    pipeline.end(play, Signal::TERM);
    let files = logs(&out);
    assert!(files.len() >= 2, "{files:?}: each is 9 s long");
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    for file in &files {
        assert_eq!(file.extension().unwrap(), "mcap", "{file:?} is finished");
        let mut check = randt(&["log", "check"]);
        check.arg(file);
        let checked = ended(check);
        assert_eq!(checked.code, Some(0), "{}", checked.stdout);
        let info = info(file);
        for name in [
            "config", "robot", "versions", "layouts", "machine", "clock", "file",
        ] {
            assert!(
                info["metadata"][format!("randt/{name}")].is_object(),
                "{name} in {file:?}"
            );
        }
        let versions = info["metadata"]["randt/versions"].as_object().unwrap();
        for name in ["filter", "odometry", "mapper", "recorder"] {
            assert!(versions.contains_key(name), "{name} in {versions:?}");
        }
        assert_eq!(info["missing"].as_array().unwrap().len(), 0, "{info}");
        for (topic, found) in info["topics"].as_object().unwrap() {
            *counts.entry(topic.clone()).or_default() += found["messages"].as_u64().unwrap();
        }
    }
    let original = info(&input);
    for topic in [RadarScan::NAME, ImuSampleTopic::NAME] {
        let expected = original["topics"][topic]["messages"].as_u64().unwrap();
        assert_eq!(counts[topic], expected, "{topic}");
    }
    for topic in [
        "radar/points/v1",
        "odometry/state/v1",
        "odometry/keyframe/v1",
        "mapper/graph/v1",
        "mapper/grid/v1",
        "stage/health/v1",
        "view/pose",
        "view/transforms",
        "view/points",
        "view/grid",
        "view/cells",
        "view/graph",
        "view/loops",
    ] {
        assert!(
            counts.get(topic).is_some_and(|count| *count > 0),
            "{topic}: {counts:?}"
        );
    }
    // The first file alone is a drive.
    let computed = run(&files[0], &folder.path().join("run"), &[]);
    assert_eq!(computed.code, Some(0), "{}", computed.stderr);
    read_ros2(&files, None);
    read_rerun(&files);
}

#[test]
fn killed_fifty_times_it_never_loses_more_than_the_last_second() {
    const LOST_MAX_NS: i64 = 1_500_000_000;
    let folder = tempfile::tempdir().unwrap();
    // Without a jump in it, for as long as the kills take.
    let input = log(folder.path(), 420);
    let out = folder.path().join("logs");
    let mut pipeline = Pipeline::new("rk");
    pipeline.play(&input, &["--stay"]);
    let clock = Clock::in_domain(pipeline.domain()).unwrap();
    let seed = 50;
    println!("seed {seed}");
    let mut random = Random(seed);
    let mut lives = Vec::new();
    for _ in 0..50 {
        let recorder = pipeline.record(&out, &[]);
        let begin_ns = clock.now_ns();
        std::thread::sleep(Duration::from_millis(random.below(2600) as u64));
        let end_ns = clock.now_ns();
        pipeline.end(recorder, Signal::KILL);
        lives.push((begin_ns, end_ns, logs(&out).len()));
    }
    let files = logs(&out);
    let contents: Vec<_> = files.iter().map(|file| published(file)).collect();
    // What a recorder that was killed did not write the next one found on the bus.
    let all: BTreeMap<_, _> = contents.iter().flatten().map(|(k, v)| (*k, *v)).collect();
    let (mut worst_ns, mut judged) = (0, 0);
    for (life, (begin_ns, end_ns, count)) in lives.iter().enumerate() {
        let there = &contents[..*count];
        let of_life = all
            .iter()
            .filter(|(_, at_ns)| (*begin_ns..=*end_ns).contains(at_ns));
        for (key, at_ns) in of_life {
            judged += 1;
            if !there.iter().any(|file| file.contains_key(key)) {
                let age_ns = end_ns - at_ns;
                worst_ns = worst_ns.max(age_ns);
                assert!(
                    age_ns <= LOST_MAX_NS,
                    "life {life}: {key:?} was {age_ns} ns old"
                );
            }
        }
    }
    println!(
        "{judged} messages; the oldest that a kill lost: {:.3} s",
        worst_ns as f64 * 1e-9
    );
    assert!(judged > 5000, "{judged}");
    // A file that a kill left recovers to a whole one.
    let cut = files
        .iter()
        .rev()
        .find(|file| fs::metadata(file).unwrap().len() > 200_000);
    let cut = cut.expect("some of them recorded a second");
    let mut recover = randt(&["log", "recover"]);
    recover.arg(cut);
    let recovered = ended(recover);
    assert_eq!(recovered.code, Some(0), "{}", recovered.stderr);
    let whole = cut.with_extension("");
    let there = published(&whole);
    assert!(!there.is_empty());
    assert_eq!(there, published(cut), "and the old one is as it was");
    let mut again = randt(&["log", "recover"]);
    again.arg(cut);
    assert_eq!(
        ended(again).code,
        Some(1),
        "nothing is overwritten silently"
    );
    let computed = run(&whole, &folder.path().join("run"), &[]);
    assert_eq!(computed.code, Some(0), "{}", computed.stderr);
}

#[test]
fn a_folder_that_is_no_folder_or_vanishes_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 200);
    let out = folder.path().join("logs");
    fs::write(&out, "a file").unwrap();
    let mut pipeline = Pipeline::new("rd");
    pipeline.compute(folder.path());
    pipeline.record(&out, &[]);
    pipeline.play(&input, &["--stay"]);
    let (printed, why) = state(&pipeline);
    assert_eq!(printed, "degraded", "{why}");
    assert!(why.contains("not recording"), "{why}");
    fs::remove_file(&out).unwrap();
    until("recording begins", || !names(&out).is_empty());
    assert_eq!(state(&pipeline).0, "running");
    // Gone while it records: it makes it anew.
    remove_folder(&out);
    until("recording goes on", || !names(&out).is_empty());
    until("it says what went with the folder", || {
        state(&pipeline).1.contains("messages are in no log")
    });
    // Everybody else went on meanwhile.
    let ended = pipeline.randt(&["top", "--once", "--json"]);
    let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
    for stage in figures["stages"].as_array().unwrap() {
        let name = stage["name"].as_str().unwrap();
        assert!(name == "recorder" || stage["state"] == "running", "{stage}");
        assert_eq!(stage["restarts"], 0, "{name}: {stage}");
    }
    let topics = figures["topics"].as_array().unwrap().iter();
    let states: Vec<_> = topics
        .filter(|topic| topic["name"] == "odometry/state/v1")
        .collect();
    let [state] = states.as_slice() else {
        panic!("no states: {figures}");
    };
    assert!(state["rate_hz"].as_f64().unwrap() > 2.5, "{state}");
    assert_eq!(state["lost"], 0, "{state}");
}

/// A disk of a few megabytes, in memory; it goes with this.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(at: &Path) -> Option<Self> {
        fs::create_dir_all(at).unwrap();
        let disk = Self(at.to_owned());
        disk.run("mount", &["-t", "tmpfs", "-o", "size=8m", "randt"])
            .then_some(disk)
    }

    fn remount(&self, how: &str) {
        assert!(self.run("mount", &["-o", &format!("remount,{how}")]));
    }

    fn run(&self, program: &str, arguments: &[&str]) -> bool {
        let mut command = Command::new(program);
        command.args(arguments).arg(&self.0);
        command.output().unwrap().status.success()
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        self.run("umount", &["-l"]);
    }
}

#[test]
fn a_real_disk_that_is_read_only_and_then_full_stops_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 200);
    let out = folder.path().join("logs");
    let Some(disk) = SmallDisk::mount(&out) else {
        let ci = std::env::var("CI").as_deref() == Ok("true");
        assert!(!ci, "a disk cannot be mounted, which only root may");
        println!("skipped: only root may mount a disk");
        return;
    };
    disk.remount("ro");
    let mut pipeline = Pipeline::new("ro");
    pipeline.compute(folder.path());
    let set = [
        "--set",
        "record.free_min_gb=0",
        "--set",
        "record.file_max_mb=2",
    ];
    let recorder = pipeline.record(&out, &set);
    pipeline.play(&input, &["--loop"]);
    until("it says that it cannot write", || {
        let (printed, why) = state(&pipeline);
        printed == "degraded" && why.contains("ead-only")
    });
    disk.remount("rw");
    until("recording begins", || state(&pipeline).0 == "running");
    let begin = Instant::now();
    let mut why = String::new();
    while !why.contains("space") {
        assert!(begin.elapsed().as_secs() < 240, "8 MB are not full: {why}");
        why = state(&pipeline).1;
    }
    // Room again; what was written is kept elsewhere.
    let full = logs(&out);
    let moved = folder.path().join("moved");
    fs::create_dir_all(&moved).unwrap();
    for file in &full {
        fs::copy(file, moved.join(file.file_name().unwrap())).unwrap();
        fs::remove_file(file).unwrap();
    }
    until("recording goes on", || state(&pipeline).0 == "running");
    // What did not fit is in the next file.
    std::thread::sleep(Duration::from_secs(2));
    pipeline.end(recorder, Signal::TERM);
    let files: Vec<_> = logs(&moved).into_iter().chain(logs(&out)).collect();
    let mut numbers: BTreeMap<_, BTreeSet<u64>> = BTreeMap::new();
    for (topic, epoch, number) in files.iter().flat_map(|file| published(file).into_keys()) {
        numbers.entry((topic, epoch)).or_default().insert(number);
    }
    assert_eq!(numbers.len(), 2, "scans and samples, of one epoch each");
    for ((topic, _), found) in numbers {
        let span = found.last().unwrap() - found.first().unwrap() + 1;
        assert_eq!(found.len() as u64, span, "{topic}: something is missing");
    }
    let ended = pipeline.randt(&["top", "--once", "--json"]);
    let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
    for stage in figures["stages"].as_array().unwrap() {
        assert_eq!(stage["restarts"], 0, "{stage}");
    }
}

#[test]
fn below_the_floor_it_is_red_and_mapping_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 40);
    let out = folder.path().join("logs");
    let mut pipeline = Pipeline::new("rf");
    pipeline.compute(folder.path());
    let recorder = pipeline.record(&out, &["--set", "record.free_min_gb=1000000"]);
    pipeline.play(&input, &["--loop"]);
    let (printed, why) = state(&pipeline);
    assert_eq!(printed, "degraded");
    assert!(why.contains("less than 1000000.0 GB"), "{why}");
    assert!(names(&out).is_empty());
    let ended = pipeline.randt(&["top", "--once", "--json"]);
    let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
    let mapper = figures["stages"].as_array().unwrap().iter();
    let mapper = mapper.filter(|stage| stage["name"] == "mapper");
    assert!(mapper.clone().all(|stage| stage["state"] == "running"));
    // What waits for room until the end is in no log.
    assert_eq!(pipeline.end(recorder, Signal::TERM), Some(3));
}
