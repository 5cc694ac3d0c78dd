//! `cargo bench -p randt --bench pipeline [-- SECONDS [RUNS] [record]]`: the pipeline as
//! processes, as on a robot. With `record` each run is followed by one with the recorder beside
//! it, and nothing else is measured.
//!
//! Prints machine, latency (wait and compute: median, p99, largest), processor time, shared memory
//! and what goes through write and send. The stages are those of the release build, started by
//! hand; the log is simulated and played as it would be driven.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a benchmark that cannot measure ends"
)]

#[allow(
    dead_code,
    unused_imports,
    reason = "the whole-program tests use the rest"
)]
mod support;

/// The parts of this benchmark.
mod pipeline_bench {
    pub mod drive;
    pub mod navtech;
    pub mod sends;
}

use pipeline_bench::drive::{Drive, Stages};
use pipeline_bench::{navtech, sends};
use randt::{latency::Latency, machine, report::Cost};
use std::path::Path;
use std::process::{Command, Stdio};
use support::stages;

/// Sweeps per second.
const RATE_HZ: u64 = 5;

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let seconds = numbers.first().copied().unwrap_or(60).max(10);
    let runs = numbers.get(1).copied().unwrap_or(3);
    let recorded = std::env::args().any(|argument| argument == "record");
    make_stages();
    println!("machine: {}", machine::description());
    println!("drive: simulated building, {seconds} s at {RATE_HZ} Hz, IMU at 250 Hz; {runs} runs");
    let folder = stages::RunFolder::new();
    let log = folder.file("building.mcap");
    let scans = (seconds * RATE_HZ).to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_randt"));
    command.args([
        "simulate", "building", "--seed", "1", "--scans", &scans, "--out",
    ]);
    let status = command.arg(&log).stdout(Stdio::null()).status().unwrap();
    assert!(status.success(), "the simulation failed: {status}");
    for run in 1..=runs {
        println!("\nrun {run}");
        drive(&folder, &log, &format!("bench-{run}"), None);
        if recorded {
            println!("\nrun {run}, recorded");
            let logs = folder.file(&format!("logs-{run}"));
            drive(&folder, &log, &format!("record-{run}"), Some(&logs));
        }
    }
    if recorded {
        return;
    }
    sends::print(&folder, &log);
    navtech::print(&folder);
}

fn drive(folder: &stages::RunFolder, log: &Path, prefix: &str, logs: Option<&Path>) {
    let mut stages = Stages::start(folder, log, prefix, logs);
    let drive = stages.drive(log);
    print_latency(&drive);
    print_costs(&drive);
    stages.stop();
}

/// The stages are programs of other packages: this benchmark's build does not make them.
fn make_stages() {
    let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
    let status = Command::new(cargo)
        .args(["build", "--release", "--quiet"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .status()
        .unwrap();
    assert!(status.success(), "the stages cannot be built: {status}");
}

fn print_latency(drive: &Drive) {
    let latencies: Vec<Latency> = drive
        .states
        .iter()
        .filter_map(Latency::from_state)
        .collect();
    let cost = |part: fn(&Latency) -> f64| {
        let times: Vec<u64> = latencies.iter().map(|l| (part(l) * 1e6) as u64).collect();
        Cost::from_times(&times)
    };
    for (name, cost) in [
        ("wait", cost(|latency| latency.wait_ms)),
        ("compute", cost(|latency| latency.compute_ms)),
    ] {
        println!(
            "{name:<8} {:4} scans: median {:.3} ms, p99 {:.3} ms, max {:.3} ms",
            cost.count, cost.median_ms, cost.p99_ms, cost.max_ms
        );
    }
    let uncovered = drive.states.len() - latencies.len();
    if uncovered > 0 {
        println!("{uncovered} scans without a covering IMU sample are not counted");
    }
}

fn print_costs(drive: &Drive) {
    let mut whole = 0.0;
    for cost in &drive.costs {
        println!(
            "{:<9} {:5.2} % of a core, {:5.1} kB/s through write()",
            cost.name, cost.processor_percent, cost.written_kb_s
        );
        if cost.name != "play" {
            whole += cost.processor_percent;
        }
    }
    println!(
        "pipeline  {whole:5.2} % of a core; play, in whose folder the drivers stand, is not in it"
    );
    println!(
        "scans     {:.0} kB/s, handed over without a copy",
        drive.scans_kb_s
    );
    println!(
        "memory    {:.1} MB in use at most: segments, iceoryx2's files, checkpoints, ring of keyframes",
        drive.memory as f64 * 1e-6
    );
}
