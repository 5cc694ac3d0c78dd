//! Drives in a row at five times the pace: memory, descriptors, threads and shared memory of every
//! process stay flat.
//!
//! Takes 26 minutes: `cargo test --test programs soak:: -- --ignored --nocapture`;
//! RANDT_SOAK_MINUTES sets another length.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::{names, stages};
use randt_stage::Registry;
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};

/// The most of the last quarter of the time is at most this much more than the most of an early
/// one. The most, because a log's index grows until the file is full, which takes four minutes.
const GROWTH_MAX: f64 = 1.1;
/// The early quarter, as parts of the time.
const EARLY: std::ops::Range<f64> = 0.125..0.375;
const LATE: std::ops::Range<f64> = 0.75..f64::INFINITY;
/// Its memory grows with the map.
const MAPPER: &str = "mapper";
/// These take in the whole pose graph, which the mapper publishes again and again: the most that
/// they grow, as a part of what the mapper does.
const GRAPH_READERS: [&str; 2] = ["view", "recorder"];
const GRAPH_READERS_MAX: f64 = 0.03;
const LOOK: Duration = Duration::from_secs(5);

/// What a process takes.
#[derive(Clone, Copy, Debug, Default)]
struct Taken {
    memory_kb: u64,
    descriptors: u64,
    threads: u64,
}

impl Taken {
    fn by_process(pid: u64) -> Option<Self> {
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

    fn at_most(self, other: Self) -> Self {
        Self {
            memory_kb: self.memory_kb.max(other.memory_kb),
            descriptors: self.descriptors.max(other.descriptors),
            threads: self.threads.max(other.threads),
        }
    }
}

/// The most that each process, and the bus, took in a part of the time.
#[derive(Default)]
struct Most {
    processes: BTreeMap<String, Taken>,
    shared_bytes: u64,
}

impl Most {
    fn take(&mut self, own: &Pipeline) {
        for (entry, _) in Registry::all(own.domain())
            .into_iter()
            .filter(|(_, lives)| *lives)
        {
            if let Some(taken) = Taken::by_process(entry.pid) {
                let most = self.processes.entry(entry.name).or_default();
                *most = most.at_most(taken);
            }
        }
        self.shared_bytes = self.shared_bytes.max(stages::memory(own.domain()));
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
    let (mut early, mut late) = (Most::default(), Most::default());
    while begin.elapsed() < span {
        std::thread::sleep(LOOK);
        let part = begin.elapsed().div_duration_f64(span);
        for (range, most) in [(EARLY, &mut early), (LATE, &mut late)] {
            if range.contains(&part) {
                most.take(&own);
            }
        }
    }
    println!("{minutes} minutes; the most of an early quarter, and of the last one:");
    println!("process        memory, MB   descriptors    threads");
    let mut grown = Vec::new();
    let [map, map_late] = [&early, &late].map(|most| most.processes[MAPPER].memory_kb);
    let map_kb = map_late - map;
    for (name, now) in &late.processes {
        let then = early.processes[name];
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
            told if GRAPH_READERS.contains(&told) => grown_kb <= GRAPH_READERS_MAX * map_kb as f64,
            _ => is_flat(then.memory_kb, now.memory_kb),
        };
        let rest = is_flat(then.descriptors, now.descriptors) && is_flat(then.threads, now.threads);
        if !memory || !rest {
            grown.push(name.clone());
        }
    }
    let [then, now] = [early, late].map(|most| most.shared_bytes as f64 * 1e-6);
    println!("shared memory {then:.1} MB, {now:.1} MB");
    assert_eq!(own.end(recorder, Signal::TERM), Some(0), "the recorder");
    assert!(grown.is_empty(), "{grown:?} grow");
    assert!(now <= GROWTH_MAX * then, "shared memory grows");
}
