//! Two laps of each world that comes with the program: loops, accuracy, and what happens without
//! parts of the method.
//!
//! Nine drives, each simulated once and computed two to four times, in two threads; a minute or
//! two.

use crate::support::{ended_within, figures, randt};
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Every step of a trial takes seconds; the machine may be shared.
const STEP_MAX: Duration = Duration::from_secs(600);
/// Trials at a time: what a small machine has cores.
const THREADS: usize = 2;
const SEEDS: [u64; 3] = [1, 2, 3];
/// The experiments with a part missing are made on this drive only.
const SEED_OF_EXPERIMENTS: u64 = SEEDS[0];

/// What a world asks for.
#[derive(Debug)]
struct World {
    name: &'static str,
    ate_max_m: f64,
    recall_min: f64,
}

/// The longest first, so that both threads end together. A tunnel looks the same everywhere.
const WORLDS: [World; 3] = [
    World {
        name: "building",
        ate_max_m: 0.10,
        recall_min: 0.7,
    },
    World {
        name: "yard",
        ate_max_m: 0.10,
        recall_min: 0.7,
    },
    World {
        name: "tunnel",
        ate_max_m: 0.20,
        recall_min: 0.5,
    },
];

/// The figures of one computation.
#[derive(Debug)]
struct Found {
    ate_m: f64,
    worst_1s_m: f64,
    lost_track: bool,
    loops: u64,
    false_loops: usize,
    recall: f64,
}

/// One drive, computed in several ways.
#[derive(Debug)]
#[allow(dead_code, reason = "the seed is shown where a check fails")]
struct Trial {
    world: &'static World,
    seed: u64,
    all: Found,
    no_loops: Found,
    no_deskew: Option<Found>,
    no_verify: Option<Found>,
}

static TRIALS: LazyLock<Vec<Trial>> = LazyLock::new(trials);

fn trials() -> Vec<Trial> {
    let drives: Vec<(&World, u64)> = WORLDS
        .iter()
        .flat_map(|world| SEEDS.map(|seed| (world, seed)))
        .collect();
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((world, seed)) = drives.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push(trial(world, *seed));
        }
        done
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        threads
            .into_iter()
            .flat_map(|thread| thread.join().unwrap())
            .collect()
    })
}

/// Simulates, computes, prints a row. The log, 350 MB, goes with the folder.
fn trial(world: &'static World, seed: u64) -> Trial {
    let begin = Instant::now();
    let folder = tempfile::tempdir().unwrap();
    let (log, truth) = (
        folder.path().join("drive.mcap"),
        folder.path().join("truth.tum"),
    );
    let mut command = randt(&["simulate", world.name, "--seed", &seed.to_string()]);
    command.arg("--out").arg(&log).arg("--truth").arg(&truth);
    let ended = ended_within(command, STEP_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found = |more: &[&str]| found(&log, &truth, &folder.path().join("out"), more);
    let experiment =
        |wanted: bool, more: &[&str]| (wanted && seed == SEED_OF_EXPERIMENTS).then(|| found(more));
    let no_deskew = ["--no-loops", "--set", "odometry.deskew=false"];
    let trial = Trial {
        world,
        seed,
        all: found(&[]),
        no_loops: found(&["--no-loops"]),
        no_deskew: experiment(world.name == "building", &no_deskew),
        no_verify: experiment(true, &["--set", "loops.verify=false"]),
    };
    let all = &trial.all;
    println!(
        "{:<8} seed {seed}: ATE {:.4} m, without loops {:.4} m, {} of {} loops false, recall {:.1} %, \
         worst 1 s {:.3} m ({:.1} s)",
        world.name,
        all.ate_m,
        trial.no_loops.ate_m,
        all.false_loops,
        all.loops,
        100.0 * all.recall,
        all.worst_1s_m,
        begin.elapsed().as_secs_f64()
    );
    trial
}

fn found(log: &Path, truth: &Path, out: &Path, more: &[&str]) -> Found {
    let mut command = randt(&["run", "--profile", "mixed"]);
    command.arg(log).arg("--out").arg(out).args(more);
    let ended = ended_within(command, STEP_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let figures = figures(out, "trajectory.tum", truth);
    let number = |name: &str| figures[name].as_f64().unwrap();
    let loops = &figures["loops"];
    Found {
        ate_m: number("ate_rmse_m"),
        worst_1s_m: number("worst_1s_translation_m"),
        lost_track: figures["lost_track"].as_bool().unwrap(),
        loops: loops["loops"].as_u64().unwrap(),
        false_loops: loops["false_loops"].as_array().unwrap().len(),
        recall: loops["recall"].as_f64().unwrap(),
    }
}

/// Checks every trial before it fails, so that one run shows all that is wrong.
#[track_caller]
fn each(what: &str, holds: impl Fn(&Trial) -> bool) {
    let wrong: Vec<&Trial> = TRIALS.iter().filter(|trial| !holds(trial)).collect();
    assert_eq!(TRIALS.len(), WORLDS.len() * SEEDS.len());
    assert!(wrong.is_empty(), "{what}: {wrong:#?}");
}

#[test]
fn no_loop_is_false() {
    each("a false loop", |trial| trial.all.false_loops == 0);
}

#[test]
fn most_places_are_recognised() {
    each("recall", |trial| trial.all.recall >= trial.world.recall_min);
}

#[test]
fn the_track_is_never_lost() {
    each("lost", |trial| {
        !trial.all.lost_track && !trial.no_loops.lost_track
    });
}

#[test]
fn the_map_is_exact() {
    each("ATE", |trial| trial.all.ate_m <= trial.world.ate_max_m);
}

#[test]
fn loops_take_three_tenths_of_the_error_away_at_least() {
    each("ATE with and without loops", |trial| {
        trial.no_loops.loops == 0 && trial.all.ate_m <= 0.7 * trial.no_loops.ate_m
    });
}

/// Of odometry alone: loops correct what a sweep's own motion does to the map.
#[test]
fn without_deskew_the_error_doubles_at_least() {
    let mut drives = 0;
    for trial in TRIALS.iter() {
        if let Some(without) = &trial.no_deskew {
            let (all, without) = (trial.no_loops.ate_m, without.ate_m);
            println!("{} {all:.3} m, {without:.3} m", trial.world.name);
            assert!(without >= 2.0 * all, "{trial:#?}");
            drives += 1;
        }
    }
    assert_eq!(drives, 1);
}

#[test]
fn without_verification_false_loops_get_in() {
    let mut false_loops = 0;
    for trial in TRIALS.iter() {
        if let Some(without) = &trial.no_verify {
            println!(
                "{}: {} of {} loops false, ATE {:.3} m",
                trial.world.name, without.false_loops, without.loops, without.ate_m
            );
            false_loops += without.false_loops;
        }
    }
    assert!(false_loops > 0, "verification has nothing to do");
}
