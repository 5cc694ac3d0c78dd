//! `cargo bench -p randt`: what a scan costs, and how much faster than real time a whole run is.
//!
//! Prints machine, data, median and p99. A scan's cost is filter + NDT + motion estimation in this
//! process; the whole run is the binary itself on one core, every output written.

use randt::{job, machine, report::Cost};
use randt_config::{Config, Selection};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Runs of each measurement; the median of them counts.
const RUNS: usize = 5;
/// Scans of the simulated log: over three minutes of driving.
const SCANS: u32 = 1000;
/// Time of one sweep of the iSDR-C, s.
const PERIOD_S: f64 = 0.2;

fn main() -> anyhow::Result<()> {
    println!("machine: {}", machine::description());
    let folder = std::env::temp_dir().join(format!("randt-bench-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let result = measure(&folder);
    fs::remove_dir_all(&folder)?;
    result
}

fn measure(folder: &Path) -> anyhow::Result<()> {
    let log = folder.join("building.mcap");
    let randt = env!("CARGO_BIN_EXE_randt");
    let scans = SCANS.to_string();
    let status = Command::new(randt)
        .args([
            "simulate", "building", "--seed", "1", "--scans", &scans, "--out",
        ])
        .arg(&log)
        .stdout(Stdio::null())
        .status()?;
    anyhow::ensure!(status.success(), "the simulation failed: {status}");

    println!(
        "\nfilter + NDT + motion estimation per scan (of {RUNS} runs the one with the median median)"
    );
    match data()
        .map(|data| data.join("bags/room.bag"))
        .filter(|bag| bag.exists())
    {
        Some(bag) => ["indoor", "mixed"]
            .iter()
            .try_for_each(|profile| scan_cost(&bag, profile))?,
        None => println!("room.bag: skipped, no data (RANDT_DATA)"),
    }
    scan_cost(&log, "mixed")?;

    println!("\nwhole run of {SCANS} simulated scans on one core, all outputs written");
    let mut seconds = Vec::new();
    for _ in 0..RUNS {
        let begin = Instant::now();
        let status = Command::new("taskset")
            .args(["-c", "0", randt, "run"])
            .arg(&log)
            .arg("--out")
            .arg(folder.join("out"))
            .stdout(Stdio::null())
            .status()?;
        anyhow::ensure!(status.success(), "the run failed: {status}");
        seconds.push(begin.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let (median, worst) = (seconds[RUNS / 2], seconds[RUNS - 1]);
    let driven = f64::from(SCANS) * PERIOD_S;
    println!(
        "median {median:.2} s, slowest {worst:.2} s: {:.0} times faster than real time ({driven:.0} s)",
        driven / median
    );
    Ok(())
}

fn scan_cost(input: &Path, profile: &str) -> anyhow::Result<()> {
    let mut costs = Vec::new();
    for _ in 0..RUNS {
        let mut source = randt_readers::open(input, &randt_readers::Options::default())?;
        let loaded = Config::load(&Selection {
            profile: Some(profile.to_owned()),
            ..Selection::default()
        })?;
        let config = job::with_mounting(loaded, source.as_ref()).config;
        let done = job::run(
            source.as_mut(),
            &config,
            true,
            &indicatif::ProgressBar::hidden(),
        )?;
        costs.push(Cost::from_times(
            &done.pipeline.timing.filter_and_odometry_ns(),
        ));
    }
    costs.sort_by(|a, b| a.median_ms.total_cmp(&b.median_ms));
    let cost = &costs[RUNS / 2];
    println!(
        "{:<14} {profile:<7} {:5} scans: median {:.3} ms, p99 {:.3} ms, max {:.3} ms",
        input.file_name().unwrap_or_default().to_string_lossy(),
        cost.count,
        cost.median_ms,
        cost.p99_ms,
        cost.max_ms
    );
    Ok(())
}

fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("RANDT_DATA")
        .map(PathBuf::from)
        .or(Some(beside))
        .filter(|path| path.is_dir())
}
