//! Logs without silent holes: what a recorder that was away, or whose publishers were replaced
//! meanwhile, could not get any more stands in `log/drop`, and a command that reads the log ends
//! with exit code 3.

use crate::support::pipeline::{Pipeline, log};
use crate::support::{Ended, ended, names, randt, run};
use randt_log::{LogReader, channels};
use randt_messages::{
    DropCause, ImuSampleTopic, LogDrop, LogDropTopic, OdometryStateTopic, RadarScan, Topic,
    health::text_of,
};
use rustix::process::Signal;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What logs hold together.
#[derive(Default)]
struct Held {
    /// Numbers by topic and publisher's start.
    numbers: BTreeMap<(String, u64), BTreeSet<u64>>,
    drops: Vec<LogDrop>,
}

impl Held {
    fn in_files(files: &[PathBuf]) -> Self {
        let ours: BTreeSet<String> = channels().into_iter().map(|c| c.topic).collect();
        let mut held = Self::default();
        for file in files {
            let mut reader = LogReader::open(file).unwrap();
            reader.whole_chunks_only();
            while let Some(entry) = reader.next_entry().unwrap() {
                if let Some(drop) = entry.decode::<LogDropTopic>().unwrap() {
                    held.drops.push(*drop.head);
                } else if ours.contains(&entry.channel.topic) {
                    let header = entry.header().unwrap();
                    let key = (entry.channel.topic.clone(), header.epoch);
                    held.numbers.entry(key).or_default().insert(header.sequence);
                }
            }
        }
        held
    }

    /// Messages between the first and the last of each publisher that are not there, by topic.
    fn missing(&self) -> BTreeMap<&str, u64> {
        let mut missing = BTreeMap::new();
        for ((topic, _), numbers) in &self.numbers {
            let span = numbers.last().unwrap() - numbers.first().unwrap() + 1;
            *missing.entry(topic.as_str()).or_default() += span - numbers.len() as u64;
        }
        missing
    }

    /// What is missing of a topic for a cause, by the logs.
    fn reported(&self, topic: &str, cause: DropCause) -> u64 {
        let drops = self.drops.iter();
        let of = drops.filter(|d| text_of(&d.topic) == topic && d.cause == cause as u32);
        of.map(|drop| drop.count).sum()
    }
}

fn logs(folder: &Path) -> Vec<PathBuf> {
    names(folder).iter().map(|name| folder.join(name)).collect()
}

fn of_log(action: &str, file: &Path) -> Ended {
    let mut command = randt(&["log", action]);
    command.arg(file);
    ended(command)
}

#[test]
fn what_a_recorder_that_was_away_for_too_long_could_not_get_is_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    // At five times the pace histories reach back 1.3 to 1.6 s.
    let input = log(folder.path(), 200);
    let out = folder.path().join("logs");
    let mut pipeline = Pipeline::new("lh");
    let recorder = pipeline.record(&out, &[]);
    pipeline.compute(folder.path());
    let play = pipeline.play(&input, &["--rate", "5", "--loop"]);
    std::thread::sleep(Duration::from_millis(1500));
    pipeline.end(recorder, Signal::KILL);
    std::thread::sleep(Duration::from_secs(3));
    let recorder = pipeline.record(&out, &[]);
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!(pipeline.end(recorder, Signal::TERM), Some(3));

    let files = logs(&out);
    let held = Held::in_files(&files);
    for (topic, missing) in held.missing() {
        let reported = held.reported(topic, DropCause::Missed);
        println!("{topic}: {missing} missing, {reported} reported");
        // A kill between a write and the note of it costs a chunk, half a second, that is there
        // and reported as missing.
        assert!((missing..=2 * missing).contains(&reported), "{topic}");
    }
    for topic in [
        RadarScan::NAME,
        ImuSampleTopic::NAME,
        OdometryStateTopic::NAME,
    ] {
        assert!(
            held.missing()[topic] > 0,
            "{topic}: the test came to nothing"
        );
    }
    let second = files.last().unwrap();
    for action in ["info", "check"] {
        let looked = of_log(action, second);
        assert_eq!(looked.code, Some(3), "{action}: {}", looked.stdout);
        let words = "of odometry/state/v1: missed on the bus";
        assert!(looked.stdout.contains(words), "{}", looked.stdout);
    }
    let computed = run(second, &folder.path().join("run"), &[]);
    assert_eq!(computed.code, Some(3), "{}", computed.stderr);
    assert!(
        computed.stderr_contains("messages_not_recorded"),
        "{}",
        computed.stderr
    );

    // The drivers are replaced while nobody records: how much their last ones sent unheard nobody
    // knows.
    let recorder = pipeline.record(&out, &[]);
    std::thread::sleep(Duration::from_millis(500));
    pipeline.end(recorder, Signal::KILL);
    pipeline.end(play, Signal::KILL);
    pipeline.play(&input, &["--rate", "5", "--loop"]);
    let recorder = pipeline.record(&out, &[]);
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(pipeline.end(recorder, Signal::TERM), Some(3));
    let held = Held::in_files(&logs(&out)[files.len()..]);
    for topic in [RadarScan::NAME, ImuSampleTopic::NAME] {
        let cause = DropCause::Replaced;
        assert_eq!(held.reported(topic, cause), 1, "{topic}: {:?}", held.drops);
    }
}

#[test]
fn what_a_recorder_that_is_killed_again_and_again_misses_is_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 150);
    let out = folder.path().join("logs");
    let mut pipeline = Pipeline::new("lb");
    pipeline.compute(folder.path());
    pipeline.play(&input, &["--stay"]);
    // Files of a second: kills meet rotations too.
    let set = ["--set", "record.file_max_s=1"];
    let lives = [1700, 2050, 1030].map(Duration::from_millis);
    for life in lives {
        let recorder = pipeline.record(&out, &set);
        std::thread::sleep(life);
        pipeline.end(recorder, Signal::KILL);
        std::thread::sleep(Duration::from_millis(2500));
    }
    let recorder = pipeline.record(&out, &set);
    std::thread::sleep(Duration::from_millis(500));
    let code = pipeline.end(recorder, Signal::TERM);
    let held = Held::in_files(&logs(&out));
    let count = |drops: &[LogDrop]| drops.iter().map(|drop| drop.count).sum::<u64>();
    let reported = count(&held.drops);
    println!(
        "{:?} missing, {reported} reported, exit code {code:?}",
        held.missing()
    );
    // Nothing, where the disk keeps up: histories reach back for over 5 s.
    for (topic, missing) in held.missing() {
        assert!(
            held.reported(topic, DropCause::Missed) >= missing,
            "{topic}"
        );
    }
    assert!(reported > 0 || code == Some(0), "{code:?}");
    assert!(held.numbers.len() > 8, "{:?}", held.numbers.keys());
}

#[test]
fn two_recorders_of_two_pipelines_into_one_folder_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 30);
    let out = folder.path().join("logs");
    let mut pipelines = ["la", "lc"].map(Pipeline::new);
    let set = ["--set", "record.file_max_s=1"];
    let recorders = pipelines.each_mut().map(|own| own.record(&out, &set));
    for own in &mut pipelines {
        own.play(&input, &["--stay"]);
    }
    std::thread::sleep(Duration::from_secs(7));
    for (own, recorder) in pipelines.iter_mut().zip(recorders) {
        assert_eq!(own.end(recorder, Signal::TERM), Some(0));
    }
    let files = logs(&out);
    assert!(files.iter().all(|file| file.extension().unwrap() == "mcap"));
    let held = Held::in_files(&files);
    let scans = held
        .numbers
        .iter()
        .filter(|((topic, _), _)| topic == RadarScan::NAME);
    let scans: Vec<usize> = scans.map(|(_, numbers)| numbers.len()).collect();
    assert_eq!(scans, [30, 30]);
    assert!(held.missing().values().all(|missing| *missing == 0) && held.drops.is_empty());
}
