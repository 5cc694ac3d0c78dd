//! `randt-lab graph` as a user calls it: the published optima, and false loops among the true
//! ones.

use crate::support::{ended, lab, recording};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A map bent by more than this is of no use, m.
const ATE_MAX_M: f64 = 0.5;
/// Share of the true loops that may go.
const DROPPED_MAX: f64 = 0.03;

fn graph(file: &Path, arguments: &[&str]) -> Value {
    let mut command = lab(&["graph", "--json"]);
    command.arg(file).args(arguments);
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Seeds of a day. [`they_stay_straight_ten_times`] has more.
const SEEDS: u64 = 2;

/// Random false loops and groups of false ones that agree, that many seeds of each; prints a row
/// per trial.
fn stays_straight(name: &str, seeds: u64) {
    let Some(file) = recording(&format!("posegraph/{name}.g2o")) else {
        return;
    };
    let kinds = [
        ["--false-loops", "10"],
        ["--false-loops", "70"],
        ["--false-groups", "5,10"],
    ];
    let trials: Vec<_> = kinds
        .into_iter()
        .flat_map(|kind| (1..=seeds).map(move |seed| (kind, seed)))
        .collect();
    // Trials have nothing to do with each other: every core takes its share.
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut rows = std::thread::scope(|scope| {
        let share = |first: usize| {
            let own = trials.iter().enumerate().skip(first).step_by(threads);
            own.map(|(index, (kind, seed))| (index, trial(name, &file, kind, *seed)))
                .collect::<Vec<_>>()
        };
        let running: Vec<_> = (0..threads)
            .map(|first| scope.spawn(move || share(first)))
            .collect();
        let ended = running
            .into_iter()
            .flat_map(|thread| thread.join().unwrap());
        ended.collect::<Vec<_>>()
    });
    rows.sort_by_key(|(index, _)| *index);
    println!("graph   false loops         seed   ATE m   false kept   true dropped      ms");
    for (_, (row, _)) in &rows {
        println!("{row}");
    }
    let bad = rows.iter().filter(|(_, (_, is_good))| !is_good);
    let bad: Vec<_> = bad.map(|(_, (row, _))| row).collect();
    assert!(bad.is_empty(), "{bad:#?}");
}

/// One trial: its row, and whether the map is straight, without a false loop, and has its true
/// ones.
fn trial(name: &str, file: &Path, kind: &[&str; 2], seed: u64) -> (String, bool) {
    let figures = graph(file, &[kind[0], kind[1], "--seed", &seed.to_string()]);
    let ate_m = figures["ate_m"].as_f64().unwrap();
    let dropped = figures["true_dropped"].as_f64().unwrap();
    let is_good = ate_m < ATE_MAX_M
        && figures["false_kept"] == 0
        && dropped < DROPPED_MAX * figures["loops"].as_f64().unwrap();
    let row = format!(
        "{name:<7} {:<19} {seed:4} {ate_m:7.4} {:>12} {:>14} {:7.0}",
        kind.join(" "),
        figures["false_kept"].as_u64().unwrap(),
        figures["true_dropped"].as_u64().unwrap(),
        figures["recheck_ms"].as_f64().unwrap()
    );
    (row, is_good)
}

#[test]
fn m3500_stays_straight() {
    stays_straight("M3500", SEEDS);
}

#[test]
fn intel_stays_straight() {
    stays_straight("intel", SEEDS);
}

#[test]
fn csail_stays_straight() {
    stays_straight("CSAIL", SEEDS);
}

#[test]
fn kitti_05_stays_straight() {
    stays_straight("kitti_05", SEEDS);
}

/// Odometry whose heading may be off by five degrees at every step: gates are as wide as the map.
#[test]
fn ring_city_stays_straight() {
    stays_straight("ringCity", SEEDS);
}

/// `cargo test --test programs graph:: -- --ignored --nocapture`
#[test]
#[ignore = "two minutes of computing"]
fn they_stay_straight_ten_times() {
    for name in ["M3500", "intel", "CSAIL", "kitti_05"] {
        stays_straight(name, 10);
    }
}

#[test]
fn optima_are_the_published_ones_from_odometry_alone() {
    for (name, poses, edges, optimum) in [
        ("CSAIL", 1045, 1172, 40.5551),
        ("intel", 1728, 2512, 45.0047),
        ("M3500", 3500, 5453, 137.913),
        ("kitti_05", 2761, 2826, 157.104),
        ("ringCity", 2361, 3261, 262.818),
    ] {
        let Some(file) = recording(&format!("posegraph/{name}.g2o")) else {
            return;
        };
        let figures = graph(&file, &[]);
        println!("{name}: {figures}");
        assert_eq!(
            (&figures["poses"], &figures["edges"]),
            (&poses.into(), &edges.into())
        );
        assert_eq!(figures["converged"], true);
        let chi2 = figures["chi2"].as_f64().unwrap();
        assert!((chi2 / optimum - 1.0_f64).abs() < 1e-4, "{name}: {chi2}");
    }
}

/// Two laps around a square of 10 m, odometry and the second lap's loops.
fn laps() -> String {
    let turn = |step: usize| {
        if step % 10 == 9 {
            core::f64::consts::FRAC_PI_2
        } else {
            0.0
        }
    };
    let information = "400 0 0 400 0 365";
    let mut text: String = (0..80)
        .map(|k| {
            format!(
                "EDGE_SE2 {k} {} 1 0 {} {information}\n",
                k + 1,
                turn(k) + 0.004
            )
        })
        .collect();
    for k in 0..=40 {
        text += &format!("EDGE_SE2 {k} {} 0.02 -0.01 0 {information}\n", k + 40);
    }
    text
}

#[test]
fn people_get_a_table_and_the_same_seed_the_same_figures() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("laps.g2o");
    fs::write(&file, laps()).unwrap();
    let mut command = lab(&["graph", "--false-loops", "30", "--seed", "3"]);
    command.arg(&file);
    let table = ended(command).stdout;
    for words in [
        "81 poses, 121 edges, 41 of them loops",
        "optimum: chi2",
        "with 13 false loops (seed 3): ATE",
    ] {
        assert!(table.contains(words), "{table}");
    }
    let figures = |seed: &str| {
        let mut figures = graph(&file, &["--false-groups", "1,5", "--seed", seed]);
        // Times are the machine's.
        figures["time_ms"].take();
        figures["recheck_ms"].take();
        figures
    };
    let first = figures("1");
    assert_eq!(first, figures("1"));
    assert_eq!(first["start"], "odometry");
    assert_eq!(first["false_kept"], 0, "{first}");
    assert!(first["ate_m"].as_f64().unwrap() < 0.1, "{first}");
}

#[test]
fn ids_are_names_as_gtsam_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("symbols.g2o");
    let symbol = |k: u64| (u64::from(b'x') << 56) + k;
    let (a, b, c) = (symbol(0), symbol(1), symbol(2));
    let text = format!(
        "VERTEX_SE2 {a} 0 0 0\nVERTEX_SE2 {b} 1 0 0\nVERTEX_SE2 {c} 1 1 0.5\n\
         EDGE_SE2 {a} {b} 1 0 0 1 0 0 1 0 1\nEDGE_SE2 {b} {c} 0 1 0.5 1 0 0 1 0 1\n\
         EDGE_SE2 {a} {c} 1 1 0.5 1 0 0 1 0 1\n"
    );
    fs::write(&file, text).unwrap();
    let figures = graph(&file, &[]);
    assert_eq!(figures["poses"], 3);
    assert_eq!(
        (&figures["edges"], &figures["loops"]),
        (&3.into(), &1.into())
    );
    assert!(figures["chi2"].as_f64().unwrap() < 1e-12, "{figures}");
}

/// Four nodes of which no two edges say the same.
const CONTRADICTIONS: &str = "\
EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1
EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1
EDGE_SE2 2 3 1 0 0 1 0 0 1 0 1
EDGE_SE2 0 2 -7 7 -3 1 0 0 1 0 1
EDGE_SE2 0 3 2 5 1 1 0 0 1 0 1
EDGE_SE2 1 3 -6 5 1 1 0 0 1 0 1
";

#[test]
fn what_has_no_minimum_in_reach_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("contradictions.g2o");
    fs::write(&file, CONTRADICTIONS).unwrap();
    let mut command = lab(&["graph"]);
    command.arg(&file);
    let ended = ended(command);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.stdout.contains("NOT converged"), "{ended:?}");
    assert!(ended.stderr_contains("not converged"), "{ended:?}");
}

#[test]
fn what_cannot_be_solved_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.g2o");
    let good = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
    for (text, arguments, says) in [
        ("", &[][..], "no VERTEX_SE2 and no EDGE_SE2"),
        (
            "EDGE_SE3:QUAT 0 1\n",
            &[],
            "line 1: \"EDGE_SE3:QUAT\", expected VERTEX_SE2 or EDGE_SE2",
        ),
        (
            "EDGE_SE2 0 1 1 0 nan 1 0 0 1 0 1\n",
            &[],
            "line 1: \"nan\", expected a number",
        ),
        (
            "EDGE_SE2 3 3 1 0 0 1 0 0 1 0 1\n",
            &[],
            "from node 0 to itself",
        ),
        (
            "EDGE_SE2 0 1 1 0 0 1 5 0 1 0 1\n",
            &[],
            "not positive definite",
        ),
        (
            "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 7 1 0 0 1 0 0 1 0 1\n",
            &[],
            "EDGE_SE2 0 7: there is no VERTEX_SE2 7",
        ),
        (good, &["--false-loops", "10"], "no loops in it"),
    ] {
        fs::write(&file, text).unwrap();
        let mut command = lab(&["graph"]);
        command.arg(&file).args(arguments);
        let ended = ended(command);
        assert_eq!(ended.code, Some(1), "{text}: {ended:?}");
        assert!(ended.stderr_contains(says), "{text}: {ended:?}");
    }
    for arguments in [
        ["--false-loops", "0"],
        ["--false-loops", "1000"],
        ["--false-groups", "5"],
        ["--false-groups", "0,3"],
    ] {
        let mut command = lab(&["graph"]);
        command.arg(&file).args(arguments);
        assert_eq!(ended(command).code, Some(2), "{arguments:?}");
    }
    fs::write(&file, good).unwrap();
    assert_eq!(graph(&file, &[])["chi2"], 0.0);
}
