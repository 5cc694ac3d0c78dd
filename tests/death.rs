//! Any stage may die at any moment: it is back soon, alone, and the drive's result is to the last
//! bit that of an undisturbed one.
//!
//! The form for every day has 13 kills in two minutes, each kind of fault once; the long one has
//! 60 and more in a drive of ten minutes: `cargo build --workspace && cargo test --test programs
//! death:: -- --ignored --nocapture`.

use crate::support::killer::{
    APART, BACK_MAX_MS, InjectedFault, Killer, OCCASION_MAX, Row, STAGES,
};
use crate::support::pipeline::Pipeline;
use crate::support::up::{PATIENT, up};
use crate::support::{Random, ended_within, l_shaped_world, randt, report, tum};
use randt_mapper::journal;
use randt_messages::Message;
use randt_stage::{Domain, Leftover, leftovers, wipe};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Scans that must have a pose.
const POSES_MIN: f64 = 0.97;
/// No fault falls within this time before the end of the drive.
const REST_S: f64 = 10.0;
/// A fault that waits for nothing takes less than this, with the pause after it.
const FAULT_S: f64 = 8.0;
/// What is left over is counted when nothing has happened for this long.
const QUIET: Duration = Duration::from_secs(2);
/// Simulating and computing ten minutes takes a fraction of that.
const COMPUTED_MAX: Duration = Duration::from_secs(600);

/// A drive and what is done in it.
struct Ordeal {
    world: PathBuf,
    scans: u64,
    /// From when on loops are closed, s.
    second_lap_s: f64,
    faults: Vec<(&'static str, InjectedFault)>,
    /// Whether stages go on being killed until the drive ends.
    to_the_end: bool,
}

fn times(
    count: usize,
    stage: &'static str,
    fault: InjectedFault,
) -> Vec<(&'static str, InjectedFault)> {
    vec![(stage, fault); count]
}

#[test]
fn every_fault_once_leaves_no_trace_in_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let world = folder.path().join("hall.world");
    fs::write(&world, l_shaped_world::WORLD).unwrap();
    let faults = [
        times(1, "filter", InjectedFault::StartUp),
        times(2, "odometry", InjectedFault::StartUp),
        // One that misses is tried again and counts as a kill: so a few more than a third.
        times(2, "mapper", InjectedFault::StartUp),
        times(1, "mapper", InjectedFault::With("odometry")),
        times(1, "odometry", InjectedFault::With("filter")),
        times(1, "odometry", InjectedFault::Turn),
        times(1, "odometry", InjectedFault::CatchingUp),
        times(1, "filter", InjectedFault::Plain),
        times(1, "mapper", InjectedFault::Closing),
        times(1, "odometry", InjectedFault::Stop),
    ];
    check(&Ordeal {
        world,
        scans: 640,
        second_lap_s: 50.0,
        faults: faults.concat(),
        to_the_end: false,
    });
}

#[test]
#[ignore = "takes twelve minutes"]
fn sixty_kills_and_more_in_ten_minutes_leave_no_trace_in_the_result() {
    let mut faults = Vec::new();
    for stage in STAGES {
        faults.extend(times(9, stage, InjectedFault::StartUp));
        faults.extend(times(2, stage, InjectedFault::Turn));
        faults.extend(times(2, stage, InjectedFault::Plain));
        faults.extend(times(2, stage, InjectedFault::CatchingUp));
        faults.extend(times(1, stage, InjectedFault::Stop));
    }
    faults.extend(times(3, "mapper", InjectedFault::Closing));
    faults.extend(times(5, "mapper", InjectedFault::With("odometry")));
    faults.extend(times(3, "odometry", InjectedFault::With("filter")));
    faults.extend(times(3, "filter", InjectedFault::With("mapper")));
    check(&Ordeal {
        world: PathBuf::from("building"),
        scans: 3100,
        second_lap_s: 300.0,
        faults,
        to_the_end: true,
    });
}

fn check(ordeal: &Ordeal) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let log = simulate(ordeal, folder.path());
    let mut command = randt(&["run"]);
    command.arg(&log).arg("--out").arg(at("run")).args(PATIENT);
    let ended = ended_within(command, COMPUTED_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let accepted = &report(&at("run"))["loops"]["statuses"]["accepted"];
    assert!(accepted.as_u64().unwrap() > 0, "a drive without loops");

    let own = Pipeline::new("death");
    let mut up = Up::start(own.domain(), &log, folder.path());
    let (killer, entries) = drive(ordeal, own.domain(), &mut up);
    let processes = killer.kills();
    let Killer { observer, rows, .. } = killer;
    observer.leave();
    // A child that failed by itself has written why; one that was killed writes nothing.
    let output = up.end();
    let failed: Vec<&str> = output.lines().filter(|l| l.contains("error")).collect();
    assert!(
        failed.is_empty(),
        "a stage failed by itself: {failed:#?}\n{output}"
    );
    check_result(ordeal, &at("up"), &at("run"));
    check_counters(&at("up"), &at("run"), processes);
    check_rows(&rows, entries);
    let wiped = wipe(own.domain(), false).unwrap();
    println!("{:?} entries wiped", wiped.map(|all| all.len()));
    assert_eq!(leftovers(own.domain()), [], "after doctor --clean");
}

fn simulate(ordeal: &Ordeal, folder: &Path) -> PathBuf {
    let log = folder.join("drive.mcap");
    let mut command = randt(&["simulate"]);
    if ordeal.world.is_file() {
        command.arg("--world");
    }
    command.arg(&ordeal.world).arg("--out").arg(&log);
    command.args(["--scans", &ordeal.scans.to_string()]);
    let ended = ended_within(command, COMPUTED_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    log
}

/// `randt up`, running.
struct Up {
    child: Child,
    stderr: PathBuf,
}

impl Up {
    fn start(domain: &Domain, log: &Path, folder: &Path) -> Self {
        let stderr = folder.join("up.stderr");
        let child = up(domain, log, &folder.join("up"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(&stderr).unwrap())
            .spawn()
            .unwrap();
        let mut up = Self { child, stderr };
        // A process that enters before it would keep it from starting.
        let begin = Instant::now();
        let runs = || {
            let all = randt_stage::Registry::all(domain);
            all.iter()
                .any(|(entry, lives)| entry.name == "play" && *lives)
        };
        while !runs() {
            assert!(begin.elapsed() < Duration::from_secs(60), "{}", up.stderr());
            assert!(up.child.try_wait().unwrap().is_none(), "{}", up.stderr());
            std::thread::sleep(Duration::from_millis(20));
        }
        up
    }

    fn stderr(&self) -> String {
        fs::read_to_string(&self.stderr).unwrap()
    }

    /// Waits for its end, which comes by itself; gives what it wrote.
    fn end(&mut self) -> String {
        let begin = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(begin.elapsed() < COMPUTED_MAX, "{}", self.stderr());
            std::thread::sleep(Duration::from_millis(50));
        };
        assert_eq!(status.code(), Some(0), "{}", self.stderr());
        self.stderr()
    }
}

impl Drop for Up {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let output = self.stderr();
            let lines: Vec<&str> = output.lines().collect();
            let last = &lines[lines.len().saturating_sub(40)..];
            println!("randt up wrote last:\n{}", last.join("\n"));
        }
        // Its children end with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// All faults; with them the entries of iceoryx2 before and after, while the pipeline runs.
fn drive(ordeal: &Ordeal, domain: &Domain, up: &mut Up) -> (Killer, [usize; 2]) {
    let seed = std::env::var("RANDT_SEED").map_or_else(
        |_| {
            let now = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap();
            now.as_secs()
        },
        |seed| seed.parse().unwrap(),
    );
    let mut killer = Killer::enter(domain, seed);
    killer.observer.until(QUIET, |_| false);
    let before = leftovers(domain);

    let end_s = ordeal.scans as f64 * 0.2 - REST_S;
    let mut faults = ordeal.faults.clone();
    shuffle(&mut faults, &mut killer.random);
    loop {
        let now_s = killer.observer.driven_s();
        let left_s = end_s - now_s;
        if left_s < 0.0 {
            assert!(faults.is_empty(), "the drive is over, but not {faults:?}");
            break;
        }
        let at = next_fault(&faults, left_s, now_s > ordeal.second_lap_s);
        let (stage, fault) = match at {
            Some(at) => faults.remove(at),
            None if faults.is_empty() && !ordeal.to_the_end => break,
            None => {
                let (start_ups, kills) = (start_ups(&killer.rows), kills(&killer.rows));
                let is_short = 3 * start_ups <= kills.iter().sum::<usize>() + 3;
                let fault = if is_short {
                    InjectedFault::StartUp
                } else {
                    InjectedFault::Plain
                };
                (STAGES[killer.random.below(3)], fault)
            }
        };
        killer.strike(stage, fault);
        if killer.rows.last().is_some_and(|row| !row.hit) {
            faults.push((stage, fault));
        }
        // Evenly over the drive, at random.
        let spare_s = left_s / (faults.len() + 1) as f64 - APART.as_secs_f64();
        let spare_s = spare_s.clamp(0.0, 5.0) * killer.random.below(1000) as f64 / 1000.0;
        let pause = APART + Duration::from_secs_f64(spare_s);
        killer.observer.until(pause, |_| false);
        assert!(up.child.try_wait().unwrap().is_none(), "{}", up.stderr());
    }
    killer.observer.until(QUIET, |_| false);
    let after = leftovers(domain);
    println!("{}", kinds(&before, &after));
    let entries = [before.len(), after.len()];
    summarise(&killer.rows, entries);
    (killer, entries)
}

/// The next fault that can be injected now. One that waits for a turn comes first as soon as a
/// long straight would leave too little time for the others.
fn next_fault(
    faults: &[(&'static str, InjectedFault)],
    left_s: f64,
    is_second_lap: bool,
) -> Option<usize> {
    let needed_s = OCCASION_MAX.as_secs_f64() + FAULT_S * faults.len() as f64;
    let position = |suits: &dyn Fn(InjectedFault) -> bool| {
        let mut all = faults.iter();
        all.position(|(_, fault)| suits(*fault))
    };
    position(&|fault| fault == InjectedFault::Turn)
        .filter(|_| left_s < needed_s)
        .or_else(|| position(&|fault| fault != InjectedFault::Closing || is_second_lap))
}

/// Which kinds of entries there are more of.
fn kinds(before: &[Leftover], after: &[Leftover]) -> String {
    let count = |all: &[Leftover]| {
        let mut counts = BTreeMap::<String, i64>::new();
        for entry in all {
            let kind = entry.path.extension().unwrap_or_default();
            *counts
                .entry(kind.to_string_lossy().into_owned())
                .or_default() += 1;
        }
        counts
    };
    let (before, after) = (count(before), count(after));
    let more = after.iter().map(|(kind, count)| {
        let was = before.get(kind).copied().unwrap_or(0);
        format!("{kind} {was} -> {count}")
    });
    more.collect::<Vec<_>>().join(", ")
}

fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for i in (1..items.len()).rev() {
        items.swap(i, random.below(i + 1));
    }
}

/// Kills inside the start-up window.
fn start_ups(rows: &[Row]) -> usize {
    let hits = rows
        .iter()
        .filter(|r| r.fault == InjectedFault::StartUp && r.hit);
    hits.count()
}

/// Rows in which each stage died.
fn kills(rows: &[Row]) -> [usize; 3] {
    STAGES.map(|stage| rows.iter().filter(|row| row.kills(stage)).count())
}

/// Times until stages were back, ms, in order.
fn back_ms(rows: &[Row]) -> Vec<f64> {
    let all = rows.iter().flat_map(|row| &row.back_ms);
    let mut back: Vec<f64> = all.map(|(_, ms)| *ms).collect();
    back.sort_by(f64::total_cmp);
    back
}

fn summarise(rows: &[Row], [before, after]: [usize; 2]) {
    let hits = |fault| rows.iter().filter(|r| r.fault == fault && r.hit).count();
    let back = back_ms(rows);
    println!(
        "{:?} kills of {STAGES:?}, {} while starting, {} in turns, {} at a keyframe of the second lap; \
         back after {:.0} ms (median), {:.0} ms (worst); entries {before} -> {after}",
        kills(rows),
        start_ups(rows),
        hits(InjectedFault::Turn),
        hits(InjectedFault::Closing),
        back[back.len() / 2],
        back[back.len() - 1],
    );
}

fn check_rows(rows: &[Row], [before, after]: [usize; 2]) {
    let start_ups = start_ups(rows);
    let share = start_ups as f64 / kills(rows).iter().sum::<usize>() as f64;
    assert!(
        share >= 1.0 / 3.0,
        "only {share:.2} of the kills fell into the start-up window"
    );
    let worst = back_ms(rows).into_iter().fold(0.0, f64::max);
    assert!(worst < BACK_MAX_MS, "back after {worst:.0} ms");
    let most = before + start_ups;
    assert!(
        after <= most,
        "{after} entries of iceoryx2 instead of {most} at most"
    );
}

/// Nothing was lost and nothing is counted but how often stages came back.
fn check_counters(found: &Path, expected: &Path, kills: u64) {
    let [mut found, expected] = [found, expected].map(|out| report(out)["counters"].clone());
    let restarts = found.as_object_mut().unwrap().remove("stage_restarts");
    assert_eq!(restarts.unwrap()["count"], kills);
    assert_eq!(found, expected);
}

fn check_result(ordeal: &Ordeal, found: &Path, expected: &Path) {
    let rows = tum(&found.join("odometry.tum")).len();
    println!("{rows} of {} scans have a pose", ordeal.scans);
    assert!(rows as f64 >= POSES_MIN * ordeal.scans as f64);
    let bytes = fs::read(found.join("map.journal")).unwrap();
    let (_, records) = journal::records(&bytes).unwrap();
    let mut message = Message::default();
    for (expected, record) in records.of_kind(journal::Kind::Keyframe).enumerate() {
        assert!(journal::read_keyframe(record.payload, &mut message));
        assert_eq!(
            message.head.id, expected as u64,
            "keyframes without a gap, each once"
        );
    }
    for name in ["odometry.tum", "keyframes.tum", "trajectory.tum", "map.pgm"] {
        let [found, expected] =
            [found, expected].map(|folder| fs::read(folder.join(name)).unwrap());
        let differs = found.iter().zip(&expected).position(|(a, b)| a != b);
        assert!(found == expected, "{name}: differs at byte {differs:?}");
        println!("{name}: identical");
    }
}
