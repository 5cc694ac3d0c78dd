//! `randt up`: the whole pipeline as child processes, for a desk or a test.

mod child;
mod ending;
mod journal;
mod launch;
mod processes;
mod program;
mod watch;

use crate::{earlier, exit::Outcome, input::InputOptions, job, output};
use anyhow::ensure;
use ending::Ending;
use processes::Processes;
use randt_config::{Loaded, SelectionArguments};
use randt_imu::Imu;
use randt_radar::Radar;
use randt_readers::Source;
use randt_stage::DomainArguments;
use std::path::PathBuf;

/// Refuses a configuration that a driver would end by.
pub fn check_drivers(loaded: &Loaded, no_imu: bool) -> anyhow::Result<()> {
    let mut config = loaded.config.clone();
    // Nothing is to be written yet.
    config.record.dense.clear();
    let origins = &loaded.origins;
    let radar = Radar::new(&config).map_err(|error| error.in_configuration(origins));
    // As itself, so that the exit code is that of a wrong configuration.
    radar.map_err(|error| match error.downcast::<randt_config::Error>() {
        Ok(error) => anyhow::Error::from(*error),
        Err(error) => anyhow::Error::from_boxed(error),
    })?;
    if !no_imu {
        Imu::new(&config).map_err(|error| error.in_configuration(origins))?;
    }
    Ok(())
}

/// Arguments of `randt up`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Play this recording to the pipeline instead of starting the drivers of the radar and the
    /// IMU
    #[arg(long, value_name = "LOG")]
    play: Option<PathBuf>,
    /// Start neither: drivers of your own publish
    #[arg(long, conflicts_with = "play")]
    no_drivers: bool,
    /// How many times faster than it was recorded
    #[arg(long, value_name = "R", default_value = "1", requires = "play", value_parser = crate::commands::play::rate)]
    rate: f64,
    /// Folder for the files that `randt run` leaves, and the map's journal
    #[arg(long, value_name = "DIR", default_value = "randt-up")]
    out: PathBuf,
    /// Record every topic into this folder, as randt-recorder does
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    /// Show it live to Foxglove and Lichtblick, as randt-view does: at view.listen
    #[arg(long)]
    view: bool,
    /// Do not use the IMU, nor start its driver
    #[arg(long)]
    no_imu: bool,
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    domain: DomainArguments,
    #[command(flatten)]
    options: InputOptions,
}

/// Starts everything, watches it, ends it, and leaves the files.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    // A closed terminal (SIGHUP) too; of the other signals a stage has handlers of its own.
    job::catch_interrupts();
    let options = arguments.options.options();
    let source = arguments
        .play
        .as_ref()
        .map(|log| randt_readers::open(log, &options));
    let source = source.transpose()?;
    let loaded = configuration(&arguments.selection, source.as_deref())?;
    if arguments.play.is_none() && !arguments.no_drivers {
        check_drivers(&loaded, arguments.no_imu)?;
    }
    output::prepare_folder(&arguments.out)?;
    let domain = arguments.domain.domain()?;
    ensure!(
        randt_stage::wipe(&domain, true)?.is_some(),
        "{}: a pipeline runs here already, or a stage of one; stop it, or give this one another --prefix (a recorder is started by --record, a view by --view)",
        domain.folder().display()
    );
    earlier::keep_drive(&arguments.out)?;
    let (mut processes, journal) =
        Processes::start(&arguments, &domain, &loaded, source.as_deref())?;
    let end = processes.watch();
    processes.stop();
    let ending = Ending {
        domain: &domain,
        out: &arguments.out,
        config: &loaded.config,
        use_imu: !arguments.no_imu,
        log: arguments.play.as_deref(),
        options,
    };
    ending.finish(processes, journal, end)
}

/// What is in force, with the mounting that the log has.
fn configuration(
    selection: &SelectionArguments,
    source: Option<&dyn Source>,
) -> anyhow::Result<Loaded> {
    let sensor = source.and_then(|source| source.info().sensor.name());
    let loaded = selection.load(sensor)?;
    Ok(match source {
        Some(source) => job::with_mounting(loaded, source),
        None => loaded,
    })
}
