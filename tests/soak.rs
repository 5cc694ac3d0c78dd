//! Drives in a row at five times the pace: memory, descriptors, threads and shared memory of every process stay flat.
//!
//! Takes 26 minutes: `cargo test --test programs soak:: -- --ignored --nocapture`; RANDT_SOAK_MINUTES says
//! another length.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::{names, stages};
use randt_stage::Registry;
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};

/// At the end at most this much more than at an eighth of the time.
const GROWTH_MAX: f64 = 1.1;
/// Its memory grows with the map.
const MAPPER: &str = "mapper";
/// The viewers' process holds the pose graph that it shows: so much of what a keyframe takes in the mapper, at most.
const SHOWN_MAX: f64 = 0.02;
const LOOK: Duration = Duration::from_secs(5);

/// What a process takes.
#[derive(Clone, Copy, Debug, Default)]
struct Taken {
    memory_kb: u64,
    descriptors: u64,
    threads: u64,
}

impl Taken {
    fn of(pid: u64) -> Option<Self> {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
        let number = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            line.split_whitespace().next()?.parse().ok()
        };
        Some(Self {
            memory_kb: number("VmRSS:")?,
            descriptors: fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as u64,
            threads: number("Threads:")?,
        })
    }
}

#[test]
#[ignore = "takes 26 minutes"]
fn drives_in_a_row_leave_every_process_as_it_was() {
    let minutes = std::env::var("RANDT_SOAK_MINUTES").map_or(26.0, |m| m.parse().unwrap());
    let span = Duration::from_secs_f64(minutes * 60.0);
    let folder = tempfile::tempdir().unwrap();
    // 40 s at this pace, then the robot stands at its beginning again.
    let log = log(folder.path(), 1000);
    let mut own = Pipeline::new("soak");
    let recorder = own.record(&folder.path().join("logs"), &[]);
    own.compute(folder.path());
    own.stage("view");
    own.play(&log, &["--rate", "5", "--loop"]);
    until("a drive", || !names(&folder.path().join("logs")).is_empty());
    let begin = Instant::now();
    let mut early: BTreeMap<String, Taken> = BTreeMap::new();
    let mut late = early.clone();
    let (mut shared_early, mut shared_late) = (0, 0);
    while begin.elapsed() < span {
        std::thread::sleep(LOOK);
        let living = Registry::all(own.realm()).into_iter();
        late = living
            .filter(|(_, lives)| *lives)
            .filter_map(|(entry, _)| Some((entry.name, Taken::of(entry.pid)?)))
            .collect();
        shared_late = stages::memory(own.realm());
        if begin.elapsed() < span / 8 || early.is_empty() {
            early.clone_from(&late);
            shared_early = shared_late;
        }
    }
    println!("{minutes} minutes; at an eighth of the time, and at the end:");
    println!("process        memory, MB   descriptors    threads");
    let mut grown = Vec::new();
    let map_kb = late[MAPPER].memory_kb - early[MAPPER].memory_kb;
    for (name, now) in &late {
        let then = early[name];
        let mb = |taken: &Taken| taken.memory_kb as f64 * 1e-3;
        println!(
            "{name:<10} {:>7.1} {:>7.1} {:>6} {:>6} {:>5} {:>4}",
            mb(&then),
            mb(now),
            then.descriptors,
            now.descriptors,
            then.threads,
            now.threads
        );
        let is_flat = |then: u64, now: u64| now as f64 <= GROWTH_MAX * then as f64;
        let grown_kb = now.memory_kb.saturating_sub(then.memory_kb) as f64;
        let memory = match name.as_str() {
            MAPPER => true,
            "view" => grown_kb <= SHOWN_MAX * map_kb as f64,
            _ => is_flat(then.memory_kb, now.memory_kb),
        };
        let rest = is_flat(then.descriptors, now.descriptors) && is_flat(then.threads, now.threads);
        if !memory || !rest {
            grown.push(name.clone());
        }
    }
    let [then, now] = [shared_early, shared_late].map(|bytes| bytes as f64 * 1e-6);
    println!("shared memory {then:.1} MB, {now:.1} MB");
    // 3: a disk did not answer for longer than the messages that wait have room, and the logs say what that cost.
    let code = own.end(recorder, Signal::TERM);
    println!("recorder: exit code {code:?}");
    assert!([Some(0), Some(3)].contains(&code), "{code:?}");
    assert!(grown.is_empty(), "{grown:?} grow");
    assert!(now <= GROWTH_MAX * then, "shared memory grows");
}
