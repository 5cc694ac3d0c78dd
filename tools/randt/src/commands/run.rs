//! `randt run`: a radar log in, a trajectory and a map out.

use crate::{
    compare, digest,
    exit::Outcome,
    finish_drive::{Drive, Shown, finish_drive},
    input::InputOptions,
    job,
    journal_input::{JournalInput, journal_of},
    output::prepare_folder,
    pipeline::Pipeline,
    progress, report,
};
use anyhow::{Context, anyhow, ensure};
use randt_config::SelectionArguments;
use randt_messages::OdometryState;
use randt_odometry::Odometry;
use randt_readers::Source;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `randt run`.
#[derive(Debug, Default, clap::Args)]
pub struct Arguments {
    /// A folder of polar images (Oxford, Boreas, MulRan, RADIATE), a ROS 1 bag, a ROS 2 bag (MCAP,
    /// db3, or its folder), one of our logs, a folder of them, a mission, or a
    /// map.journal (its keyframes)
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Folder for the trajectories, odometry.csv (every scan's pose with covariance and trust),
    /// the map, the picture and report.json
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not use the IMU
    #[arg(long)]
    no_imu: bool,
    /// Do not close loops: the map is odometry's
    #[arg(long)]
    no_loops: bool,
    /// Compare with the poses that were published when this log was recorded; ends with 1 where
    /// one is another
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
            ..Self::default()
        }
    }
}

/// Computes, writes, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let shown = compute(arguments)?;
    Ok(match shown.same {
        Some(false) => Outcome::Failed,
        _ => Outcome::finished(shown.lost),
    })
}

/// The same, with what it shows.
pub fn compute(arguments: Arguments) -> anyhow::Result<Shown> {
    job::catch_interrupts();
    let begin = Instant::now();
    if let Some(journal) = journal_of(&arguments.input) {
        return compute_journal(&arguments, &journal, begin);
    }
    let mut source = randt_readers::open(&arguments.input, &arguments.options.options())?;
    let info = source.info();
    let recorded = info.configuration.clone();
    let loaded = (arguments.selection).load_recorded(info.sensor.name(), recorded)?;
    for problem in &loaded.passed_over {
        eprintln!("passed over: {problem}");
    }
    let mut config = job::fit_input(loaded, source.as_mut())?.config;
    config.loops.enabled &= !arguments.no_loops;
    // Before the work: whether there is anything to compare with.
    let published = (arguments.compare).then(|| compare::published(&arguments.input));
    let published = published.transpose()?;
    prepare_folder(&arguments.out)?;

    let bar = progress::bar(source.info().scans, "scans");
    let done = job::run(source.as_mut(), &config, !arguments.no_imu, &bar);
    let done = done.map_err(|error| with_choice(error, source.as_ref()))?;
    let input = arguments.input.as_path();
    let use_imu = !arguments.no_imu && done.imu_samples > 0;
    let mut counters = report::reader_counters(input, &source.counters());
    counters.append(done.counters());
    let drive = Drive {
        input: report::input(source.info(), input, use_imu, done.imu_samples)?,
        pipeline: done.pipeline,
        results: done.results,
        config: &config,
        counters,
        published,
    };
    let timing = |pipeline: &Pipeline, _: &[OdometryState]| {
        let whole_ns = begin.elapsed().as_nanos() as u64;
        report::timing(&pipeline.timing, &done.read_ns, whole_ns)
    };
    let shown = finish_drive(drive, timing, &arguments.out)?;
    shown.ok_or_else(|| {
        done.first_misfit
            .map_or_else(|| no_scan(input, source.as_ref()), Into::into)
    })
}

/// An error with which topic was taken, where there was a choice: another one may fit.
fn with_choice(error: anyhow::Error, source: &dyn Source) -> anyhow::Error {
    let counters = source.counters();
    let choice = counters.iter().find(|c| c.name == "radar_topic_chosen");
    match choice {
        Some(choice) => error.context(choice.first.clone()),
        None => error,
    }
}

/// The map of a journal's keyframes.
fn compute_journal(arguments: &Arguments, journal: &Path, begin: Instant) -> anyhow::Result<Shown> {
    ensure!(
        !arguments.compare,
        "{}: a journal has no poses that were published live (--compare)",
        journal.display()
    );
    let mut config = arguments.selection.load_recorded(None, None)?.config;
    config.loops.enabled &= !arguments.no_loops;
    let input = JournalInput::read(journal)?;
    prepare_folder(&arguments.out)?;
    let (mapper, results, counters) = input.compute(&config);
    let name = arguments.input.file_name().unwrap_or_default();
    let drive = Drive {
        input: report::Input {
            name: name.to_string_lossy().into_owned(),
            format: "journal".into(),
            sha256: digest::of_path(journal)?,
            imu: false,
            imu_samples: 0,
        },
        pipeline: Pipeline::resume(&config, Odometry::new(&config, false), mapper, true),
        results,
        config: &config,
        counters,
        published: None,
    };
    let timing = |pipeline: &Pipeline, _: &[OdometryState]| {
        let whole_ns = begin.elapsed().as_nanos() as u64;
        report::timing(&pipeline.timing, &[], whole_ns)
    };
    let shown = finish_drive(drive, timing, &arguments.out)?;
    shown.with_context(|| format!("{}: holds no keyframe", journal.display()))
}

fn no_scan(input: &Path, source: &dyn Source) -> anyhow::Error {
    let counters = source.counters();
    let why = counters
        .iter()
        .map(|c| format!("\n  {}: {} ({})", c.name, c.count, c.first))
        .collect::<String>();
    anyhow!("{}: holds no scan that could be used{why}", input.display())
}
