//! The figures that no change of words or structure may touch: hashes of what `randt run` writes
//! on recordings and simulated drives, as they were written down. Where a change is meant to move
//! them, their table changes with it.
//!
//! `cargo test --test programs numbers:: -- --ignored --nocapture` computes all of them in three
//! minutes and prints the table as it is now.

use crate::support::{ended_within, randt, recording, run};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// A drive of some minutes, computed on a busy machine.
const STEP_MAX: Duration = Duration::from_secs(600);
const WORLDS: [&str; 3] = ["building", "yard", "tunnel"];
const SEEDS: [u64; 3] = [1, 2, 3];
const RECORDINGS: [(&str, &str); 3] = [
    ("room.bag", "bags/room.bag"),
    ("room_loops.bag", "bags/room_loops.bag"),
    ("oxford", "radar/oxford"),
];
const FILES: [&str; 4] = ["odometry.tum", "trajectory.tum", "keyframes.tum", "map.pgm"];
/// Drive, file, hash. On machines with fused multiply-add; without it maps agree to 1e-6 m
/// (`machines.rs`).
const EXPECTED: &str = include_str!("numbers.txt");

/// The first 16 digits: enough to see a change.
fn hash(bytes: &[u8]) -> String {
    let mut digits = String::new();
    for byte in &Sha256::digest(bytes)[..8] {
        write!(digits, "{byte:02x}").unwrap();
    }
    digits
}

/// Which keyframes each loop joins, how, and whether it was accepted.
fn loops(out: &Path) -> Vec<u8> {
    let report: Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    let mut text = String::new();
    for candidate in report["loops"]["candidates"].as_array().unwrap() {
        let accepted = candidate
            .as_object()
            .unwrap()
            .values()
            .any(|value| value == "accepted");
        writeln!(
            text,
            "{} {} {} {accepted}",
            candidate["from_ns"], candidate["to_ns"], candidate["relative"]
        )
        .unwrap();
    }
    text.into_bytes()
}

/// The rows of one drive.
fn rows(drive: &str, input: &Path, more: &[&str], folder: &Path) -> Vec<String> {
    let out = folder.join("out");
    let ended = run(input, &out, more);
    assert_eq!(ended.code, Some(0), "{drive}: {}", ended.stderr);
    let mut rows: Vec<String> = FILES
        .iter()
        .map(|file| {
            format!(
                "{drive} {file} {}",
                hash(&fs::read(out.join(file)).unwrap())
            )
        })
        .collect();
    rows.push(format!("{drive} loops {}", hash(&loops(&out))));
    rows
}

/// Prints what is there and fails on whatever the table does not have.
fn check(rows: &[String]) {
    let expected: Vec<&str> = EXPECTED.lines().collect();
    for row in rows {
        println!("{row}");
    }
    let changed: Vec<&String> = rows
        .iter()
        .filter(|row| !expected.contains(&row.as_str()))
        .collect();
    assert!(changed.is_empty(), "changed: {changed:#?}");
}

fn recorded(index: usize) -> Option<Vec<String>> {
    let (drive, path) = RECORDINGS[index];
    let folder = tempfile::tempdir().unwrap();
    Some(rows(drive, &recording(path)?, &[], folder.path()))
}

#[test]
fn a_room_with_loops_keeps_its_numbers() {
    if let Some(rows) = recorded(1) {
        check(&rows);
    }
}

#[test]
#[ignore = "three minutes: every drive of the table"]
fn all_drives_keep_their_numbers() {
    let mut found: Vec<String> = (0..RECORDINGS.len())
        .filter_map(recorded)
        .flatten()
        .collect();
    for world in WORLDS {
        for seed in SEEDS {
            let folder = tempfile::tempdir().unwrap();
            let log = folder.path().join("drive.mcap");
            let mut simulate = randt(&["simulate", world, "--seed", &seed.to_string()]);
            simulate.arg("--out").arg(&log);
            let ended = ended_within(simulate, STEP_MAX);
            assert_eq!(ended.code, Some(0), "{}", ended.stderr);
            let drive = format!("{world}-{seed}");
            found.extend(rows(&drive, &log, &["--profile", "mixed"], folder.path()));
        }
    }
    check(&found);
}
