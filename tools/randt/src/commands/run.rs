//! `randt run`: a radar log in, a trajectory and a map out.

use crate::{
    compare::{self, Comparison},
    conclusion::{Conclusion, Shown},
    exit::Outcome,
    input::InputOptions,
    job::{self, Done},
    output::write_whole,
    progress,
    report::{self, Count},
};
use anyhow::{Context, bail};
use randt_config::{Config, SelectionArguments};
use randt_readers::Source;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `randt run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// An Oxford Radar RobotCar folder, a ROS 1 bag, a ROS 2 bag (MCAP, db3, or its folder), or one of our logs
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Folder for the trajectories, the map, the picture and report.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not use the IMU
    #[arg(long)]
    no_imu: bool,
    /// Do not close loops: the map is odometry's
    #[arg(long)]
    no_loops: bool,
    /// Compare with the poses that were published when this log was recorded; ends with 1 where one is another
    #[arg(long)]
    compare: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    options: InputOptions,
}

impl Arguments {
    /// An input and a folder, everything else as it is when it is not given.
    pub fn new(input: PathBuf, out: PathBuf) -> Self {
        Self {
            input,
            out,
            no_imu: false,
            no_loops: false,
            compare: false,
            selection: SelectionArguments::default(),
            options: InputOptions::default(),
        }
    }
}

/// Computes, writes, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let shown = compute(arguments)?;
    Ok(match shown.same {
        Some(false) => Outcome::Failed,
        _ if shown.lost => Outcome::DataLost,
        _ => Outcome::Good,
    })
}

/// The same, with what it shows.
pub fn compute(arguments: Arguments) -> anyhow::Result<Shown> {
    job::catch_interrupts();
    let begin = Instant::now();
    let mut source = randt_readers::open(&arguments.input, &arguments.options.options())?;
    let info = source.info();
    let recorded = info.configuration.clone();
    let loaded = (arguments.selection).load_recorded(info.sensor.name(), recorded)?;
    for problem in &loaded.passed_over {
        eprintln!("passed over: {problem}");
    }
    let mut config = job::with_mounting(loaded, source.as_ref()).config;
    config.loops.enabled &= !arguments.no_loops;
    // Before the work: whether there is anything to compare with.
    let published = match arguments.compare {
        true => Some(compare::published(&arguments.input)?),
        false => None,
    };
    prepare_folder(&arguments.out)?;

    let bar = progress::bar(source.info().scans, "scans");
    let done = job::run(source.as_mut(), &config, !arguments.no_imu, &bar)?;
    if done.results.states.is_empty() {
        let counters = source.counters();
        let why = counters
            .iter()
            .map(|c| format!("\n  {}: {} ({})", c.name, c.count, c.first))
            .collect::<String>();
        bail!(
            "{}: holds no scan that could be used{why}",
            arguments.input.display()
        );
    }
    let comparison = published.map(|published| Comparison::of(&published, &done.results.states));
    finish(
        &arguments,
        source.as_ref(),
        &config,
        &done,
        comparison,
        begin,
    )
}

/// The folder, made and tried out before the work begins.
pub fn prepare_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be made", folder.display()))?;
    let trial = folder.join(".randt-trial");
    write_whole(&trial, b"")?;
    std::fs::remove_file(&trial).with_context(|| trial.display().to_string())
}

/// Everything that was found out, written and printed.
fn finish(
    arguments: &Arguments,
    source: &dyn Source,
    config: &Config,
    done: &Done,
    comparison: Option<Comparison>,
    begin: Instant,
) -> anyhow::Result<Shown> {
    let input = arguments.input.as_path();
    let mapper = done.pipeline.mapper();
    let odometry = done.pipeline.counters();
    let mut counters = report::counters(input, &source.counters(), &odometry, &mapper.counters());
    if let Some(misfit) = &done.first_misfit {
        counters.insert(
            "scans_not_of_this_sensor",
            Count::lost(done.misfits, misfit.to_string()),
        );
    }
    if done.interrupted {
        let first = "the input was not read to its end".to_owned();
        counters.insert("interrupted", Count::lost(1, first));
    }
    let timing = report::timing(
        &done.pipeline.timing,
        &done.read_ns,
        begin.elapsed().as_nanos() as u64,
    );
    let use_imu = !arguments.no_imu && done.imu_samples > 0;
    Conclusion {
        input: report::input(source.info(), input, use_imu, done.imu_samples)?,
        results: &done.results,
        mapper,
        config,
        counters,
        timing,
        comparison,
    }
    .write(&arguments.out)
}
