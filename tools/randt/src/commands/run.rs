//! `randt run`: a radar log in, a trajectory and a map out.

mod summary;

use crate::{
    digest,
    exit::Outcome,
    final_poses::final_poses,
    input::InputOptions,
    job::{self, Done},
    loops::Loops,
    output::{print, write_whole},
    progress,
    report::{self, Accuracy, Cost, Count, Report},
};
use anyhow::{Context, bail};
use randt_config::{Config, SelectionArguments};
use randt_readers::Source;
use std::collections::BTreeMap;
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
            selection: SelectionArguments::default(),
            options: InputOptions::default(),
        }
    }
}

/// What a run shows of itself.
#[derive(Debug)]
pub struct Shown {
    /// Error against the log's truth.
    pub ate_rmse_m: Option<f64>,
    /// Length of the path.
    pub path_m: f64,
    /// Cost per stage.
    pub timing: BTreeMap<&'static str, Cost>,
    /// Whether data were lost.
    pub lost: bool,
}

/// Computes, writes, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    Ok(if compute(arguments)?.lost {
        Outcome::DataLost
    } else {
        Outcome::Good
    })
}

/// The same, with what it shows.
pub fn compute(arguments: Arguments) -> anyhow::Result<Shown> {
    job::catch_interrupts();
    let begin = Instant::now();
    let mut source = randt_readers::open(&arguments.input, &arguments.options.options())?;
    let loaded = arguments.selection.load(source.info().sensor.name())?;
    let mut config = job::with_mounting(&loaded, source.as_ref());
    config.loops.enabled &= !arguments.no_loops;
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
    finish(&arguments, source.as_ref(), &config, &done, begin)
}

/// The folder, made and tried out before the work begins.
pub fn prepare_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot be made", folder.display()))?;
    let trial = folder.join(".randt-trial");
    write_whole(&trial, b"")?;
    std::fs::remove_file(&trial).with_context(|| trial.display().to_string())
}

/// Writes all outputs and prints the summary.
fn finish(
    arguments: &Arguments,
    source: &dyn Source,
    config: &Config,
    done: &Done,
    begin: Instant,
) -> anyhow::Result<Shown> {
    let (input, out) = (arguments.input.as_path(), arguments.out.as_path());
    let use_imu = !arguments.no_imu;
    let results = &done.results;
    let name = input
        .file_name()
        .unwrap_or(input.as_os_str())
        .to_string_lossy()
        .into_owned();
    let mapper = done.pipeline.mapper();
    let trajectory = final_poses(&results.states, mapper);
    let rows = results.write(out, &name, &trajectory, mapper)?;
    let odometry = done.pipeline.counters();
    let mut counters = report::counters(input, &source.counters(), &odometry, &mapper.counters());
    if let Some(misfit) = &done.first_misfit {
        let count = Count {
            count: done.misfits,
            loss: true,
            first: misfit.to_string(),
        };
        counters.insert("scans_not_of_this_sensor", count);
    }
    if done.interrupted {
        let first = "the input was not read to its end".to_owned();
        counters.insert(
            "interrupted",
            Count {
                count: 1,
                loss: true,
                first,
            },
        );
    }
    let lost = counters.values().any(|c| c.loss);
    let evaluation = results.evaluation(&trajectory);
    let of_odometry = results.evaluation(&results.odometry());
    let sha256 = digest::of_path(input)?;
    let report = Report {
        randt: env!("CARGO_PKG_VERSION"),
        input: report::input(
            source.info(),
            name,
            sha256,
            use_imu && done.imu_samples > 0,
            done.imu_samples,
        ),
        scans: results.states.len() as u64,
        keyframes: mapper.places().len() as u64,
        path_m: results.path_m(),
        frames: results.frames(),
        trust: results.trust(),
        loops: Loops::of(mapper),
        accuracy: evaluation.as_ref().map(|e| Accuracy {
            ate_rmse_m: e.ate_rmse_m,
            odometry_ate_rmse_m: of_odometry.and_then(|e| e.ate_rmse_m),
            coverage: e.coverage,
        }),
        counters,
        configuration: config,
        trajectory_sha256: digest::of_bytes(rows.as_bytes()),
        timing: report::timing(
            &done.pipeline.timing,
            &done.read_ns,
            begin.elapsed().as_nanos() as u64,
        ),
    };
    let mut json = serde_json::to_string_pretty(&report)?;
    json.push('\n');
    write_whole(&out.join("report.json"), json.as_bytes())?;
    print(&summary::text(&report, out))?;
    // Why a run ends with 3 belongs where its errors go.
    for (name, counter) in report.counters.iter().filter(|(_, c)| c.loss) {
        eprintln!(
            "lost: {}: {}",
            input.display(),
            summary::counted(name, counter)
        );
    }
    let ate_rmse_m = evaluation.and_then(|e| e.ate_rmse_m);
    Ok(Shown {
        ate_rmse_m,
        path_m: report.path_m,
        timing: report.timing,
        lost,
    })
}
