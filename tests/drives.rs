//! Whose drive a keyframe is, and when a drive is over: nothing is spliced, nothing begins again
//! by itself.

use crate::support::journal::keyframes;
use crate::support::pipeline::{Pipeline, log_of, signal, until};
use crate::support::{ended, report};
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The journal of a drive that is over.
fn old_map(folder: &Path) -> PathBuf {
    let path = folder.join("old.journal");
    let mut pipeline = Pipeline::new("old");
    let mapper = pipeline.mapper(&path);
    pipeline.stage("odometry");
    pipeline.stage("filter");
    pipeline.play(&log_of(folder, 100, 1), &["--rate", "10", "--stay"]);
    until("the old map", || keyframes(&path).len() >= 12);
    pipeline.end(mapper, Signal::TERM);
    path
}

#[test]
fn a_new_drive_goes_on_after_the_map_that_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let journal = old_map(folder.path());
    let old = keyframes(&journal);
    // The machine was started anew: no state, and the drivers are the first to run.
    let mut pipeline = Pipeline::new("new");
    pipeline.play(&log_of(folder.path(), 100, 2), &["--rate", "4", "--stay"]);
    pipeline.stage("filter");
    pipeline.mapper(&journal);
    std::thread::sleep(Duration::from_secs(1));
    pipeline.stage("odometry");
    until("keyframes", || keyframes(&journal).len() >= old.len() + 5);
    let all = keyframes(&journal);
    assert_eq!(all[..old.len()], old);
    let last_frame = old.last().unwrap().1;
    for (expected, (id, frame)) in (old.len() as u64..).zip(&all[old.len()..]) {
        assert!(*id == expected && *frame > last_frame, "{all:?}");
    }
}

#[test]
fn a_new_drive_goes_on_after_a_map_that_the_mapper_has_yet_to_take_anew() {
    let folder = tempfile::tempdir().unwrap();
    let journal = old_map(folder.path());
    let log = log_of(folder.path(), 100, 2);
    // By the second time the journal's frame is not the first, which is what an empty map would
    // name.
    for (frame, name, hits) in [
        (1, "again", "grid.hits_min=4"),
        (2, "anew", "grid.hits_min=5"),
    ] {
        let old = keyframes(&journal);
        let mut pipeline = Pipeline::new(name);
        pipeline.play(&log, &["--rate", "4", "--stay"]);
        pipeline.stage("filter");
        pipeline.stage("odometry");
        // It starts first and subscribes, so that it gets what the mapper publishes before it has
        // taken any.
        let mapper = pipeline.mapper_by(&journal, &["--set", hits]);
        until("keyframes", || keyframes(&journal).len() >= old.len() + 5);
        pipeline.end(mapper, Signal::TERM);
        let all = keyframes(&journal);
        for (expected, found) in (old.len() as u64..).zip(&all[old.len()..]) {
            assert_eq!(*found, (expected, frame), "{all:?}");
        }
    }
}

#[test]
fn a_drive_that_had_not_heard_of_the_map_is_not_mixed_into_it() {
    let folder = tempfile::tempdir().unwrap();
    let journal = old_map(folder.path());
    let old = keyframes(&journal);
    let mut pipeline = Pipeline::new("unheard");
    pipeline.stage("odometry");
    pipeline.stage("filter");
    pipeline.play(&log_of(folder.path(), 100, 2), &["--rate", "10", "--stay"]);
    // Longer than odometry listens; it has keyframes of its own by then.
    std::thread::sleep(Duration::from_secs(4));
    pipeline.mapper(&journal);
    let quarantined = folder.path().join("old.journal.quarantined-1");
    until("the old map quarantined", || quarantined.is_file());
    until("a new map", || keyframes(&journal).len() >= 5);
    assert_eq!(
        keyframes(&quarantined),
        old,
        "whole, and nothing of the new drive"
    );
    let new = keyframes(&journal);
    let expected: Vec<_> = (0..new.len() as u64).map(|id| (id, 0)).collect();
    assert_eq!(new, expected);
}

#[test]
fn a_clock_that_was_taken_anew_does_not_make_odometry_deaf() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("map.journal");
    let log = log_of(folder.path(), 150, 1);
    let mut pipeline = Pipeline::new("clock");
    let rate = |pipeline: &mut Pipeline| {
        let stages = [
            pipeline.mapper(&journal),
            pipeline.stage("odometry"),
            pipeline.stage("filter"),
        ];
        (stages, pipeline.play(&log, &["--rate", "4", "--stay"]))
    };
    let (stages, play) = rate(&mut pipeline);
    until("keyframes", || keyframes(&journal).len() >= 5);
    for pid in stages.into_iter().chain([play]) {
        pipeline.end(pid, Signal::TERM);
    }
    let before = keyframes(&journal).len();
    // An hour back: what is published from now on has an earlier epoch.
    let anchor = pipeline.domain().run().join("clock-anchor");
    let taken: i64 = fs::read_to_string(&anchor).unwrap().trim().parse().unwrap();
    fs::write(&anchor, (taken - 3_600_000_000_000).to_string()).unwrap();
    rate(&mut pipeline);
    until("keyframes after that", || {
        keyframes(&journal).len() >= before + 3
    });
}

#[test]
fn a_log_that_was_killed_is_the_end_of_the_drive() {
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(folder.path(), 100, 1);
    let out = folder.path().join("out");
    let pipeline = Pipeline::new("killed");
    let up = pipeline.command(&["up", "--rate", "2"]);
    let running = std::thread::scope(|scope| {
        let running = scope.spawn(|| {
            let mut up = up;
            up.arg("--play").arg(&log).arg("--out").arg(&out);
            ended(up)
        });
        let play = || {
            let all = randt_stage::Registry::all(pipeline.domain());
            let found = all
                .into_iter()
                .find(|(entry, lives)| entry.name == "play" && *lives);
            found.map(|(entry, _)| entry.pid as u32)
        };
        until("play", || play().is_some());
        std::thread::sleep(Duration::from_secs(3));
        // A second pipeline does not get the first one's folder.
        let other = Pipeline::new("other");
        let mut second = other.command(&["up"]);
        second.arg("--play").arg(&log).arg("--out").arg(&out);
        let refused = ended(second);
        assert_eq!(refused.code, Some(1), "{}", refused.stderr);
        assert!(
            refused.stderr_contains("another pipeline writes its files here"),
            "{}",
            refused.stderr
        );
        signal(play().unwrap(), Signal::KILL);
        running.join().unwrap()
    });
    assert_eq!(running.code, Some(3), "{}", running.stderr);
    let report = report(&out);
    let scans = report["scans"].as_u64().unwrap();
    assert!(scans > 5 && scans < 90, "{scans}");
    assert_eq!(report["frames"].as_array().unwrap().len(), 1);
    assert_eq!(report["counters"]["interrupted"]["loss"], true);
    assert!(out.join("trajectory.tum").is_file());
}
