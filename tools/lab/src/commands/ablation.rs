//! The ablation: the method with one part after the other left out, on the same drives.

mod figures;
mod table;

use anyhow::bail;
use clap::builder::PossibleValuesParser;
use figures::{Figures, Trial};
use randt::drive::Drive;
use randt::exit::Outcome;
use randt::judgement::Judgement;
use randt::output::{may_write, prepare_folder, print_value, write_whole};
use randt::{job, machine, progress};
use randt_config::SelectionArguments;
use randt_readers::Source;
use randt_simulator::World;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `randt-lab ablation`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Worlds to drive through
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', default_values = World::NAMES)]
    #[arg(value_parser = PossibleValuesParser::new(World::NAMES))]
    worlds: Vec<String>,
    /// Number of drives through each world: seeds 1 to N
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..))]
    seeds: u64,
    /// Number of radar sweeps of each drive; if not given, two laps of its world
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    scans: Option<u64>,
    /// Also write the table to a file, as markdown
    #[arg(long, value_name = "FILE.md")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    selection: SelectionArguments,
}

/// The method without one of its parts.
struct Variant {
    name: &'static str,
    /// Keys that leave it out.
    set: &'static [&'static str],
    use_imu: bool,
}

impl Variant {
    const fn new(name: &'static str, set: &'static [&'static str]) -> Self {
        let use_imu = true;
        Self { name, set, use_imu }
    }
}

/// The table's rows: what the paper leaves out, and what we could do without besides.
const VARIANTS: [Variant; 7] = [
    Variant::new("all", &[]),
    Variant::new("no intensity dimension", &["ndt.intensity=false"]),
    Variant::new("l = 1", &["odometry.window=1"]),
    Variant::new("no graduation", &["odometry.graduation=[1.0]"]),
    Variant {
        use_imu: false,
        ..Variant::new("no IMU", &[])
    },
    Variant::new("no de-skew", &["odometry.deskew=false"]),
    Variant::new("no loops", &["loops.enabled=false"]),
];

/// All that was measured, and on what.
#[derive(Debug, Serialize)]
struct Ablation {
    /// Version of the program.
    pub randt: &'static str,
    /// Processors.
    pub machine: String,
    /// Without optimisation times mean nothing.
    pub optimised: bool,
    /// Profile and what else was chosen.
    pub configuration: String,
    /// Seeds of the drives.
    pub seeds: Vec<u64>,
    /// In the order asked for.
    pub worlds: Vec<WorldFigures>,
}

/// What was measured in one world.
#[derive(Debug, Serialize)]
struct WorldFigures {
    /// Its name.
    pub world: String,
    /// Sweeps of each drive.
    pub scans: u64,
    /// One for each variant.
    pub rows: Vec<Row>,
}

/// One variant in one world.
#[derive(Debug, Serialize)]
struct Row {
    /// What is left out.
    pub variant: &'static str,
    /// Over all seeds.
    #[serde(flatten)]
    pub figures: Figures,
}

/// Drives, computes, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    if let Some(path) = &arguments.out {
        may_write(path, true)?;
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
        prepare_folder(parent.unwrap_or(Path::new(".")))?;
    }
    job::catch_interrupts();
    let seeds: Vec<u64> = (1..=arguments.seeds).collect();
    let measured = arguments.worlds.iter().filter_map(|name| {
        let world = World::named(name)?;
        Some(measure_world(&arguments, &world, &seeds))
    });
    let ablation = Ablation {
        randt: randt_version::VERSION,
        machine: machine::description(),
        configuration: arguments.selection.description(),
        optimised: !cfg!(debug_assertions),
        worlds: measured.collect::<anyhow::Result<_>>()?,
        seeds,
    };
    let table = table::markdown(&ablation);
    if let Some(path) = &arguments.out {
        write_whole(path, table.as_bytes())?;
    }
    print_value(arguments.json, &ablation, || table)?;
    Ok(Outcome::Good)
}

fn measure_world(
    arguments: &Arguments,
    world: &World,
    seeds: &[u64],
) -> anyhow::Result<WorldFigures> {
    let scans = arguments.scans.unwrap_or_else(|| world.sweeps());
    let mut trials = VARIANTS.map(|_| Vec::new());
    for seed in seeds {
        let unit = format!("sweeps driven, {}, seed {seed}", world.name);
        let drive = Drive::new(world, scans, *seed, &progress::bar(Some(scans), &unit))?;
        for (variant, trials) in VARIANTS.iter().zip(&mut trials) {
            let unit = format!("scans, {}, seed {seed}, {}", world.name, variant.name);
            let bar = progress::bar(Some(scans), &unit);
            trials.push(trial(arguments, &drive, variant, &bar)?);
        }
    }
    let row = |(variant, trials): (&Variant, &Vec<Trial>)| Row {
        variant: variant.name,
        figures: Figures::from_trials(trials),
    };
    Ok(WorldFigures {
        world: world.name.clone(),
        scans,
        rows: VARIANTS.iter().zip(&trials).map(row).collect(),
    })
}

/// One drive by one variant.
fn trial(
    arguments: &Arguments,
    drive: &Drive,
    variant: &Variant,
    bar: &indicatif::ProgressBar,
) -> anyhow::Result<Trial> {
    let mut source = drive.source();
    let selection = arguments.selection.with(variant.set);
    let loaded = selection.load(source.info().sensor.name())?;
    let config = job::with_mounting(loaded, &source).config;
    let mut done = job::run(&mut source, &config, variant.use_imu, bar)?;
    done.finish();
    if done.interrupted {
        bail!("interrupted; nothing was written");
    }
    Ok(Trial {
        judgement: Judgement::from_run(&done)?,
        scan_ns: done.pipeline.timing.filter_and_odometry_ns(),
    })
}
