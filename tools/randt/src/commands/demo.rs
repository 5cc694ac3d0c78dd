//! `randt demo`: a simulated drive through a building, computed and compared with the truth.

use crate::{
    commands::{run, simulate},
    exit::Outcome,
    output::{prepare_folder, print},
};
use std::path::PathBuf;

/// The largest ATE that a demo may show, m: a hand's breadth over a drive through a building.
const ATE_MAX_M: f64 = 0.15;

/// Arguments of `randt demo`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for the log, the trajectories, the picture and the report
    #[arg(long, value_name = "DIR", default_value = "randt-demo")]
    out: PathBuf,
    /// Seed of the simulation
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of radar sweeps, five a second; by default one lap that closes, and a little more
    #[arg(long, default_value_t = 1600)]
    scans: u64,
}

/// Simulates, computes, judges.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let Arguments { out, seed, scans } = arguments;
    prepare_folder(&out)?;
    let log = out.join("building.mcap");
    print("1. simulating a drive through a building (radar, gyro, accelerometer, truth)\n")?;
    let drive = simulate::Arguments::new("building", log.clone(), seed, scans);
    simulate::run(drive)?;
    print("2. computing the trajectory from radar and IMU alone\n")?;
    let report = run::compute(run::Arguments::new(log, out.clone()))?;
    let stages = report.timing.iter().filter(|(stage, _)| **stage != "run");
    let mut text = String::from("3. result\n");
    for (stage, cost) in stages {
        let (median, p99, max) = (cost.median_ms, cost.p99_ms, cost.max_ms);
        text += &format!(
            "   {stage:20} median {median:7.3} ms   p99 {p99:7.3} ms   max {max:7.3} ms\n"
        );
    }
    let ate_m = report.ate_rmse_m;
    let (grade, outcome) = match ate_m {
        Some(ate_m) if ate_m <= ATE_MAX_M => ("good", Outcome::Good),
        _ => ("NOT good", Outcome::Failed),
    };
    let ate = ate_m.map_or("unknown".to_owned(), |ate_m| format!("{ate_m:.3} m"));
    text += &format!(
        "   ATE {ate} over {:.1} m driven: {grade} (at most {ATE_MAX_M} m)\n   look at {} and {}\n",
        report.path_m,
        out.join("plot.svg").display(),
        out.join("map.pgm").display()
    );
    print(&text)?;
    Ok(outcome)
}
