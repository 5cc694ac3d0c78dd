//! `cargo bench -p randt-mapper --bench journal`: how soon a mapper is back, and what its journal
//! takes.
//!
//! Prints machine, data, median and worst. The keyframes are odometry's on simulated drives.
//! `-- LAPS FILE` drives that many laps through the building instead (1,380 sweeps, 300 keyframes
//! each) and leaves their journal in a file.
#![allow(
    clippy::unwrap_used,
    reason = "a benchmark says by panicking what is wrong"
)]

mod shared;

use randt_config::Config;
use randt_drives::{Drive, config};
use randt_mapper::journal::{Bytes, Contents};
use randt_mapper::{Known, Mapper, journal};
use randt_simulator::World;
use shared::{machine, milliseconds, print};
use std::sync::Arc;
use std::time::Instant;

/// Sweeps of a lap, and those in which the building's robot makes a thousand keyframes: three laps
/// and a little.
const LAP_SCANS: u64 = 1380;
const SCANS: u64 = 4600;
const SCAN_S: f64 = 0.2;
const RESTARTS: usize = 15;
/// Limits: after this a mapper is there, after this it has all keyframes, and what a drive writes:
/// ms, ms, kB/s.
const RECALL_MAX_MS: f64 = 150.0;
const RESTART_MAX_MS: f64 = 500.0;
const RATE_MAX_KB_S: f64 = 50.0;

/// A journal as the mapper's process writes it.
struct Written {
    bytes: Vec<u8>,
    keyframes: usize,
    keyframe_bytes: usize,
    snapshots: usize,
    last_snapshot_bytes: usize,
    /// Where the last snapshot begins: the most that is ever pushed anew stands before it.
    before_last_snapshot: usize,
}

fn write(config: &Config, drive: &Drive) -> Written {
    let mut mapper = Mapper::new(config);
    let mut written = Written {
        bytes: Vec::new(),
        keyframes: drive.keyframes.len(),
        keyframe_bytes: 0,
        snapshots: 0,
        last_snapshot_bytes: 0,
        before_last_snapshot: 0,
    };
    let bytes = &mut written.bytes;
    journal::begin(config, bytes);
    let (mut after_snapshot, mut known) = (0, Known::default());
    for (count, keyframe) in (1..).zip(&drive.keyframes) {
        let start = bytes.len();
        journal::append_keyframe(keyframe.as_ref(), bytes).unwrap();
        written.keyframe_bytes += bytes.len() - start;
        mapper.push(keyframe.as_ref());
        after_snapshot += 1;
        if journal::is_snapshot_due(count, after_snapshot) {
            written.before_last_snapshot = bytes.len();
            journal::append_snapshot(&mapper, known, bytes).unwrap();
            known = mapper.known();
            written.last_snapshot_bytes = bytes.len() - written.before_last_snapshot;
            written.snapshots += 1;
            after_snapshot = 0;
        }
    }
    written
}

fn main() {
    println!("machine: {}", machine());
    let arguments: Vec<String> = std::env::args().filter(|a| a != "--bench").collect();
    if let [_, laps, file] = &arguments[..] {
        return leave(laps.parse().unwrap(), file);
    }
    for name in World::NAMES {
        let world = World::named(name).unwrap();
        let scans = world.sweeps();
        let drive = Drive::new(&world, scans, 1, &[]);
        report(name, &write(&config(&world), &drive), scans);
    }
    let world = World::building();
    let config = config(&world);
    let written = write(&config, &Drive::new(&world, SCANS, 1, &[]));
    report("building, three laps", &written, SCANS);
    judge(&config, &written);
}

/// Writes a large journal, and judges it.
fn leave(laps: u64, file: &str) {
    let world = World::building();
    let config = config(&world);
    let drive = Drive::new(&world, laps * LAP_SCANS, 1, &[]);
    let begin = Instant::now();
    let written = write(&config, &drive);
    println!("pushed in {:.0} s", begin.elapsed().as_secs_f64());
    report("building", &written, laps * LAP_SCANS);
    std::fs::write(file, &written.bytes).unwrap();
    recall(&config, &written.bytes);
}

fn judge(config: &Config, written: &Written) {
    recall(config, &written.bytes);
    restart("with all of it", config, &written.bytes);
    let worst = &written.bytes[..written.before_last_snapshot];
    restart("just before a snapshot", config, worst);

    let mut only = Vec::new();
    journal::begin(config, &mut only);
    let (_, mut records) = journal::records(&written.bytes).unwrap();
    let mut begin = records.good();
    while let Some(record) = records.next() {
        if record.kind == journal::Kind::Keyframe {
            only.extend_from_slice(&written.bytes[begin..records.good()]);
        }
        begin = records.good();
    }
    let begin = Instant::now();
    Mapper::restore(config, &only).unwrap();
    println!(
        "without any snapshot     {:.0} ms",
        milliseconds(begin.elapsed())
    );
    let (mut mapper, _) = Mapper::restore(config, &written.bytes).unwrap();
    let begin = Instant::now();
    mapper.update_grid();
    println!(
        "the grid, afterwards     {:.0} ms",
        milliseconds(begin.elapsed())
    );
}

fn report(what: &str, written: &Written, scans: u64) {
    let rate_kb_s = written.bytes.len() as f64 / (scans as f64 * SCAN_S) / 1e3;
    println!(
        "\n{what}: {} keyframes of {:.1} kB, {} snapshots, the last of {:.0} kB: {rate_kb_s:.1} kB/s (at most {RATE_MAX_KB_S})",
        written.keyframes,
        written.keyframe_bytes as f64 / written.keyframes as f64 / 1e3,
        written.snapshots,
        written.last_snapshot_bytes as f64 / 1e3,
    );
}

/// What stands between a mapper and its loop; the rest it does there.
fn recall(config: &Config, bytes: &[u8]) {
    let bytes: Bytes = Arc::new(bytes.to_vec());
    let times = (0..RESTARTS).map(|_| {
        let begin = Instant::now();
        let _recalled = Mapper::recall(config, Contents::read(&bytes).unwrap(), None);
        begin.elapsed()
    });
    print("recalled", times.collect(), Some(RECALL_MAX_MS));
    // After every keyframe one goes into memory; the first has all candidates and keys.
    let mapper = Mapper::recall(config, Contents::read(&bytes).unwrap(), None).mapper;
    for (what, known) in [
        ("a snapshot", mapper.known()),
        ("the first", Known::default()),
    ] {
        let mut length = 0;
        let times = (0..RESTARTS).map(|_| {
            let (begin, mut bytes) = (Instant::now(), Vec::new());
            journal::append_snapshot(&mapper, known, &mut bytes).unwrap();
            length = bytes.len();
            begin.elapsed()
        });
        let times = times.collect();
        print(
            &format!("{what}, {:.0} kB", length as f64 / 1e3),
            times,
            None,
        );
    }
}

fn restart(what: &str, config: &Config, bytes: &[u8]) {
    let mut replayed = 0;
    let times = (0..RESTARTS).map(|_| {
        let begin = Instant::now();
        let (_mapper, restored) = Mapper::restore(config, bytes).unwrap();
        replayed = restored.replayed;
        begin.elapsed()
    });
    let times = times.collect();
    print(
        &format!("{what}, {replayed} pushed anew"),
        times,
        Some(RESTART_MAX_MS),
    );
}
