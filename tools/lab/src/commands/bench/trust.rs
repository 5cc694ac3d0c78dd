//! `randt-lab bench trust`: worlds x seeds x faults, and what is believed there.

use super::bounds::broken;
use super::cell::{Faulty, measure};
use super::plan::{self, Request, Trial, plan};
use super::record::{self, Build, Cell, Record};
use super::summary::{groups, worse};
use super::table::table;
use super::twin::Twin;
use crate::faults::Fault;
use anyhow::{Context, bail};
use randt::drive::Drive;
use randt::exit::Outcome;
use randt::output::{prepare_folder, print};
use randt::{digest, job, progress};
use randt_config::SelectionArguments;
use randt_readers::Source;
use randt_simulator::{Robot, WheelProfile, World};
use std::collections::VecDeque;
use std::fmt::{Display, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Digits of a hash that tell two programs apart.
const HASH_DIGITS: usize = 16;

/// Arguments of `randt-lab bench trust`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Worlds: names, .world files, folders of them; if not given, all that this program has
    #[arg(long, value_name = "NAME|PATH,...", value_delimiter = ',')]
    worlds: Vec<String>,
    /// Faults in all of these worlds; if not given, none, and each in building and yard
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    faults: Vec<Fault>,
    /// Seeds 1 to N; if not given, 3, and 5 of each fault
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    seeds: Option<u64>,
    /// Radar sweeps of each drive; if not given, two laps, and 800 with a fault
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    scans: Option<u64>,
    /// Wheel odometry at 50 Hz, as of `randt simulate`
    #[arg(long, value_name = "scale=S,slip=S,noise=N,fault=F,from=T")]
    wheels: Option<WheelProfile>,
    /// Faults are there from the drive's begin on, not from some moment on
    #[arg(long)]
    from_start: bool,
    /// The short form: two worlds, one seed, half a minute
    #[arg(long, conflicts_with_all = ["worlds", "faults", "seeds", "scans"])]
    quick: bool,
    /// Drives computed at once; if not given, as many as there are processors
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Table to write and to go on with
    #[arg(long, value_name = "FILE.csv", default_value = "trust.csv")]
    out: PathBuf,
    /// Table that was accepted: what is worse is named
    #[arg(long, value_name = "FILE.csv")]
    against: Option<PathBuf>,
    #[command(flatten)]
    selection: SelectionArguments,
}

/// Drives of one simulation.
struct Work<'a> {
    world: &'a World,
    robot: Robot,
    seed: u64,
    scans: u64,
    trials: Vec<Trial>,
}

/// What the threads share.
struct Shared<'a> {
    work: VecDeque<Work<'a>>,
    record: Record,
    failed: Option<anyhow::Error>,
}

/// Drives, computes, prints.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let old = arguments.against.as_deref().map(record::read).transpose()?;
    let quick_worlds = plan::QUICK_WORLDS.map(str::to_owned);
    let (worlds, trials) = plan(&if arguments.quick {
        Request {
            worlds: &quick_worlds,
            faults: &[Fault::None],
            seeds: Some(1),
            scans: Some(plan::QUICK_SCANS),
        }
    } else {
        Request {
            worlds: &arguments.worlds,
            faults: &arguments.faults,
            seeds: arguments.seeds,
            scans: arguments.scans,
        }
    })?;
    let out = arguments.out.as_path();
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty());
    prepare_folder(parent.unwrap_or(Path::new(".")))?;
    job::catch_interrupts();
    let build = build(&arguments)?;
    let (record, done) = Record::open(out)?;
    let is_done = |trial: &Trial| done.iter().any(|c| c.build == build && c.trial == *trial);
    let left: Vec<Trial> = trials.iter().filter(|t| !is_done(t)).cloned().collect();
    let work = work(&worlds, left, arguments.wheels);
    compute(&arguments, &build, work, record)?;

    // As the file has them: a table is the same whether its drives were computed now or before.
    let all = record::read(out)?;
    let found = trials.iter().filter_map(|trial| {
        let is_it = |cell: &&Cell| cell.build == build && cell.trial == *trial;
        all.iter().find(is_it).cloned()
    });
    let cells: Vec<Cell> = found.collect();
    let groups = groups(&cells);
    let mut text = table(&groups, &build);
    let broken: Vec<_> = groups.iter().flat_map(broken).collect();
    list(&mut text, "bounds that are broken", &broken);
    let mut is_good = broken.is_empty();
    if let (Some(old), Some(path)) = (&old, &arguments.against) {
        let worse = worse(&cells, old);
        let title = format!("worse than in {} by more than the spread", path.display());
        list(&mut text, &title, &worse);
        is_good &= worse.is_empty();
    }
    print(&text)?;
    // Exit code 3 is what a script asks for; no data are lost.
    Ok(if is_good {
        Outcome::Good
    } else {
        Outcome::DataLost
    })
}

fn list(text: &mut String, title: &str, rows: &[impl Display]) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "\n{title}: {}", rows.len());
    for row in rows {
        let _ = writeln!(text, "  {row}");
    }
}

/// This program with its settings.
fn build(arguments: &Arguments) -> anyhow::Result<Build> {
    let program = std::env::current_exe().context("this program's file")?;
    let mut binary_sha256 = digest::of_path(&program)?;
    binary_sha256.truncate(HASH_DIGITS);
    let wheels = arguments.wheels.map(|w| {
        let (scale, slip, noise) = (w.scale, w.slip, w.noise_m_s);
        let (fault, from) = (w.fault, w.fault_from_s);
        format!(" wheels scale={scale} slip={slip} noise={noise} fault={fault:?} from={from}")
    });
    let wheels = wheels.unwrap_or_default();
    let onset = match arguments.from_start {
        true => " faults from the start",
        false => "",
    };
    Ok(Build {
        binary_sha256,
        randt: randt_version::VERSION.to_owned(),
        settings: arguments.selection.description() + &wheels + onset,
    })
}

/// Drives that share a simulation together.
fn work(worlds: &[World], trials: Vec<Trial>, wheels: Option<WheelProfile>) -> VecDeque<Work<'_>> {
    let mut all: VecDeque<Work<'_>> = VecDeque::new();
    for trial in trials {
        let named = |world: &&World| world.name == trial.world;
        let Some(world) = worlds.iter().find(named) else {
            continue;
        };
        let mut robot = trial.fault.robot(Robot::for_world(world));
        robot.wheels = wheels;
        let same = |work: &&mut Work<'_>| {
            let [mine, theirs] = [&trial, work.trials.first().unwrap_or(&trial)]
                .map(|trial| (trial.world.clone(), trial.seed, trial.scans));
            mine == theirs && work.robot == robot
        };
        match all.iter_mut().find(same) {
            Some(work) => work.trials.push(trial),
            None => all.push_back(Work {
                world,
                robot,
                seed: trial.seed,
                scans: trial.scans,
                trials: vec![trial],
            }),
        }
    }
    all
}

/// Computes all drives, several at once.
fn compute(
    arguments: &Arguments,
    build: &Build,
    work: VecDeque<Work<'_>>,
    record: Record,
) -> anyhow::Result<()> {
    let drives: usize = work.iter().map(|work| work.trials.len()).sum();
    let bar = progress::bar(Some(drives as u64), "drives");
    let processors = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let jobs = arguments.jobs.unwrap_or(processors).get();
    let shared = Mutex::new(Shared {
        work,
        record,
        failed: None,
    });
    let lock = || {
        shared
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    };
    let next = || {
        let mut shared = lock();
        let goes_on = shared.failed.is_none() && !job::interrupted();
        goes_on.then(|| shared.work.pop_front()).flatten()
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while let Some(work) = next() {
                    let finished = |cell: Cell| {
                        bar.inc(1);
                        lock().record.add(&cell)
                    };
                    if let Err(error) = compute_one(arguments, build, work, finished) {
                        lock().failed.get_or_insert(error);
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    if job::interrupted() {
        let out = arguments.out.display();
        bail!("interrupted; the drives that were finished are in {out}");
    }
    lock().failed.take().map_or(Ok(()), Err)
}

/// Computes the drives of one simulation.
fn compute_one(
    arguments: &Arguments,
    build: &Build,
    work: Work<'_>,
    finished: impl Fn(Cell) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let hidden = indicatif::ProgressBar::hidden();
    let drive = Drive::with_robot(work.world, work.robot, work.scans, work.seed, &hidden)?;
    let source = drive.source();
    let loaded = arguments.selection.load(source.info().sensor.name())?;
    let config = job::with_mounting(loaded, &source).config;
    let has_fault = work.trials.iter().any(|trial| trial.fault != Fault::None);
    let undisturbed = has_fault.then(|| Twin::of_drive(&drive, &config));
    let undisturbed = undisturbed.transpose()?;
    for trial in work.trials {
        let fault = Faulty {
            fault: trial.fault,
            injection: match arguments.from_start {
                true => trial.fault.injection_from_start(trial.seed),
                false => trial.fault.injection(trial.seed),
            },
        };
        let Some(figures) = measure(&drive, &config, fault, undisturbed.as_ref())? else {
            break;
        };
        finished(Cell {
            build: build.clone(),
            trial,
            figures,
        })?;
    }
    Ok(())
}
