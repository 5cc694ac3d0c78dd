//! Kills close together, so that a stage is often killed while it starts, or while it clears away
//! the one before it: no start is refused, no slot stays taken by nobody, and all stages work when
//! it is over.
//!
//! The form for every day has 100 kills; the long ones last ten minutes, and half an hour with
//! 1,000 kills under `randt up`: `cargo build --workspace && cargo test --test programs
//! kill_storm:: -- --ignored --nocapture --test-threads 1`.

use crate::support::observer::Observer;
use crate::support::pipeline::{Pipeline, log_of, until};
use crate::support::stages::{RunFolder, Running};
use crate::support::up::up;
use crate::support::{Random, ended, randt, report};
use randt_stage::{Domain, Registry, orphaned_slots};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

const STAGES: [&str; 4] = ["mapper", "odometry", "filter", "recorder"];
/// Kills of the form for every day, and the time between two of them, ms.
const KILLS: usize = 100;
const GAP_MS: [usize; 2] = [20, 400];
/// The long form, where 40 % of the kills fall into a start-up and 20 % come in pairs.
const LONG_KILLS: usize = 1000;
const LONG_GAP_MS: [usize; 2] = [20, 2000];
const LONG_SCANS: u32 = 10_000;
/// The long form with kills as close together as in the one for every day.
const STORM: Duration = Duration::from_secs(600);
const START_UP_PERCENT: usize = 40;
const PAIR_PERCENT: usize = 20;
/// A start-up takes about this long, ms.
const START_UP_MS: usize = 60;
/// After the last kill every stage delivers within this time.
const DELIVERS: Duration = Duration::from_secs(2);
/// How often it is looked whether all run.
const LOOK: Duration = Duration::from_millis(50);
/// What is waited for comes within this time, or never.
const WAIT_MAX: Duration = Duration::from_secs(30);

fn seed() -> u64 {
    let now = || {
        std::time::SystemTime::UNIX_EPOCH
            .elapsed()
            .unwrap()
            .as_secs()
    };
    let seed = std::env::var("RANDT_SEED").map_or_else(|_| now(), |seed| seed.parse().unwrap());
    println!("seed {seed}");
    seed
}

fn gap(random: &mut Random, [least, most]: [usize; 2]) -> Duration {
    Duration::from_millis((least + random.below(most - least)) as u64)
}

fn kill(pid: u32) {
    // One that has just ended cannot be killed.
    let _ = kill_process(Pid::from_raw(pid as i32).unwrap(), Signal::KILL);
}

/// The process of a stage, as the register has it.
fn pid_of(domain: &Domain, stage: &str) -> Option<u32> {
    let all = Registry::all(domain);
    let found = all
        .iter()
        .find(|(entry, lives)| *lives && entry.name == stage);
    found.map(|(entry, _)| entry.pid as u32)
}

/// Stages that are started again as soon as they have died.
struct Keeper {
    // Ended before the folder is wiped: fields are dropped in order.
    running: Vec<Running>,
    folder: RunFolder,
    domain: Domain,
    starts: usize,
}

impl Keeper {
    fn start(&mut self, stage: &str) -> Running {
        let mut command = RunFolder::command(&self.domain, stage);
        match stage {
            "mapper" => command
                .arg("--journal")
                .arg(self.folder.file("map.journal")),
            "recorder" => command.arg("--out").arg(self.folder.file("logs")),
            _ => &mut command,
        };
        self.starts += 1;
        self.folder.start(stage, command)
    }

    /// Starts each stage that has died; one that has ended by itself was refused.
    fn keep(&mut self) {
        for i in 0..self.running.len() {
            if self.running[i].ended().is_some() {
                let output = self.running[i].stderr();
                assert!(!output.contains("error"), "start {}: {output}", self.starts);
                let name = self.running[i].name.clone();
                self.running[i] = self.start(&name);
            }
        }
    }

    /// Whether every stage that was started last is in its loop or about to enter it.
    fn all_run(&self) -> bool {
        let all = Registry::all(&self.domain);
        self.running.iter().all(|stage| {
            all.iter().any(|(entry, lives)| {
                *lives && entry.pid == u64::from(stage.pid()) && entry.topics.len() > 1
            })
        })
    }

    fn keep_for(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.keep();
            std::thread::sleep(Duration::from_millis(3));
        }
    }
}

/// Kills some at random; gives how long it took after the last kill until every stage had
/// delivered.
fn storm(more: impl Fn(usize, Duration) -> bool) -> Duration {
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(folder.path(), 150, 1);
    let run_folder = RunFolder::new();
    let mut keeper = Keeper {
        domain: run_folder.domain("storm"),
        folder: run_folder,
        running: Vec::new(),
        starts: 0,
    };
    let mut random = Random(seed());
    for stage in STAGES {
        let started = keeper.start(stage);
        keeper.running.push(started);
    }
    let mut play = RunFolder::command(&keeper.domain, "play");
    play.arg("--loop").arg(&log);
    let play = keeper.folder.start("play", play);
    keeper.keep_for(Duration::from_secs(1));
    let mut observer = Observer::enter(&keeper.domain);
    let begin = Instant::now();
    let mut kills = 0;
    while more(kills, begin.elapsed()) {
        keeper.keep_for(gap(&mut random, GAP_MS));
        kill(keeper.running[random.below(STAGES.len())].pid());
        kills += 1;
    }
    let (last, last_ns) = (Instant::now(), observer.now_ns());
    // Starts queue up where the machine is busy.
    while !delivers(&keeper.domain, &observer, &STAGES, last_ns) {
        assert!(last.elapsed() < WAIT_MAX, "{:?}", observer.lives);
        observer.until(LOOK, |_| false);
        keeper.keep();
    }
    let after = last.elapsed();
    println!(
        "{kills} kills in {:.0?}, {} starts, all deliver {after:.2?} after the last kill",
        begin.elapsed(),
        keeper.starts
    );
    observer.leave();
    // Nothing but a start frees what the dead hold.
    let wait = Instant::now();
    while !(keeper.all_run() && orphaned_slots(&keeper.domain).is_empty()) {
        let left = orphaned_slots(&keeper.domain);
        assert!(wait.elapsed() < WAIT_MAX, "held by nobody: {left:?}");
        keeper.keep_for(LOOK);
    }
    let mut top = randt(&[
        "top",
        "--once",
        "--json",
        "--prefix",
        keeper.domain.prefix(),
    ]);
    top.arg("--run").arg(keeper.domain.run());
    let top = ended(top);
    let top: serde_json::Value = serde_json::from_str(&top.stdout).unwrap();
    for stage in STAGES {
        let all = top["stages"].as_array().unwrap();
        let found = all.iter().find(|found| found["name"] == stage).unwrap();
        let state = found["state"].as_str().unwrap();
        assert!(["running", "degraded"].contains(&state), "{stage}: {top:#}");
    }
    let age_s = top["robot"]["age_s"].as_f64().unwrap();
    assert!(age_s < WAIT_MAX.as_secs_f64(), "{top:#}");
    drop(play);
    keeper.running.iter_mut().for_each(|stage| {
        stage.stop();
    });
    after
}

/// Whether after an instant each of the stages has spoken, odometry by a state.
fn delivers(domain: &Domain, observer: &Observer, stages: &[&str], after_ns: i64) -> bool {
    let state = observer.state.map(|state| state.header.published_ns);
    let speaks = |stage: &&str| {
        pid_of(domain, stage)
            .is_some_and(|pid| observer.heard_ns(u64::from(pid), after_ns).is_some())
    };
    state.is_some_and(|ns| ns > after_ns) && stages.iter().all(speaks)
}

#[test]
fn a_hundred_random_kills_leave_no_slot_taken_and_no_stage_away() {
    storm(|kills, _| kills < KILLS);
}

#[test]
#[ignore = "takes ten minutes: cargo test --test programs kill_storm:: -- --ignored --nocapture"]
fn ten_minutes_of_kills_leave_no_slot_taken_and_every_stage_delivers_at_once() {
    let after = storm(|_, time| time < STORM);
    assert!(after < DELIVERS, "{after:?}");
}

/// How a kill came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Plain,
    StartUp,
    Pair,
}

#[test]
#[ignore = "takes half an hour: cargo test --test programs kill_storm:: -- --ignored --nocapture"]
fn a_thousand_kills_under_up_leave_the_result_of_an_undisturbed_run() {
    let folder = tempfile::tempdir().unwrap();
    let log = log_of(folder.path(), LONG_SCANS, 1);
    let own = Pipeline::new("storm");
    let domain = own.domain().clone();
    let out = folder.path().join("up");
    let stderr = folder.path().join("up.stderr");
    let mut child = up(&domain, &log, &out)
        // A player that is starved by the kills must not count.
        .args(["--set", "odometry.imu_wait_max_s=20"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&stderr).unwrap())
        .spawn()
        .unwrap();
    let output = || fs::read_to_string(&stderr).unwrap();
    until("play", || pid_of(&domain, "play").is_some());
    let mut observer = Observer::enter(&domain);
    let mut random = Random(seed());
    let stages = &STAGES[..3];
    let mut kills: Vec<(Kind, &str, i64)> = Vec::new();
    while kills.len() < LONG_KILLS {
        observer.until(gap(&mut random, LONG_GAP_MS), |_| false);
        assert!(child.try_wait().unwrap().is_none(), "{}", output());
        let stage = stages[random.below(stages.len())];
        let Some(pid) = pid_of(&domain, stage) else {
            continue;
        };
        let mut strike = |kind, stage, pid, now_ns| {
            kill(pid);
            kills.push((kind, stage, now_ns));
        };
        let chance = random.below(100);
        if chance < START_UP_PERCENT {
            strike(Kind::Plain, stage, pid, observer.now_ns());
            let begin = Instant::now();
            let next = loop {
                match pid_of(&domain, stage) {
                    Some(next) if next != pid => break next,
                    _ => assert!(begin.elapsed() < WAIT_MAX, "{stage} is away: {}", output()),
                }
                std::thread::sleep(Duration::from_millis(1));
            };
            let wait = random.below(START_UP_MS) as u64;
            std::thread::sleep(Duration::from_millis(wait));
            strike(Kind::StartUp, stage, next, observer.now_ns());
        } else if chance < START_UP_PERCENT + PAIR_PERCENT {
            strike(Kind::Pair, stage, pid, observer.now_ns());
            let other = stages[random.below(stages.len())];
            if let Some(other_pid) = pid_of(&domain, other).filter(|other| *other != pid) {
                strike(Kind::Pair, other, other_pid, observer.now_ns());
            }
        } else {
            strike(Kind::Plain, stage, pid, observer.now_ns());
        }
    }
    let last_ns = observer.now_ns();
    let last = Instant::now();
    let is_whole = |observer: &Observer| delivers(&domain, observer, stages, last_ns);
    let is_whole = observer.until(WAIT_MAX, is_whole);
    let after = last.elapsed();
    println!("all deliver {after:.2?} after the last kill");
    rows(&kills, &observer);
    observer.leave();
    assert!(is_whole && after < DELIVERS, "{after:?}");
    assert_eq!(orphaned_slots(&domain), BTreeMap::new(), "{}", output());
    let status = child.wait().unwrap();
    let counters = report(&out)["counters"].clone();
    println!("randt up: {status}; {counters:#}");
    assert!(matches!(status.code(), Some(0 | 3)), "{}", output());
    compare(&log, &out, folder.path(), status.code() == Some(0));
}

/// Prints a row per kind: count, and how soon after a kill the stage is back.
fn rows(kills: &[(Kind, &str, i64)], observer: &Observer) {
    println!("kind      count  back after: median, p99, worst, ms");
    for kind in [Kind::Plain, Kind::StartUp, Kind::Pair] {
        let all = kills.iter().filter(|kill| kill.0 == kind);
        let back = all.clone().filter_map(|(_, stage, killed_ns)| {
            let back_ns = observer.back_ns(stage, *killed_ns)?;
            Some((back_ns - killed_ns) as f64 * 1e-6)
        });
        let mut back: Vec<f64> = back.collect();
        back.sort_by(f64::total_cmp);
        let at = |share: f64| back.get((back.len() as f64 * share) as usize).copied();
        let [median, p99] = [0.5, 0.99].map(|share| at(share).unwrap_or(f64::NAN));
        let worst = back.last().copied().unwrap_or(f64::NAN);
        println!(
            "{:<8}  {:>5}  {median:>8.0} {p99:>8.0} {worst:>8.0}",
            format!("{kind:?}"),
            all.count()
        );
    }
}

/// Where nothing was lost the files are those of an undisturbed run.
fn compare(log: &Path, up: &Path, folder: &Path, nothing_lost: bool) {
    let run = folder.join("run");
    let mut command = randt(&["run", "--set", "odometry.imu_wait_max_s=20"]);
    command.arg(log).arg("--out").arg(&run);
    let made = ended(command);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    for name in ["odometry.tum", "keyframes.tum", "trajectory.tum", "map.pgm"] {
        let [found, expected] = [up, &run].map(|folder| fs::read(folder.join(name)).unwrap());
        let is_same = found == expected;
        println!("{name}: {}", if is_same { "identical" } else { "differs" });
        assert!(
            is_same || !nothing_lost,
            "{name} differs though nothing was lost"
        );
    }
}
