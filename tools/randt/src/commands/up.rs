//! `randt up`: the whole pipeline as child processes, for a desk or a test.

mod child;
mod harvest;
mod watch;

use crate::{
    exit::Outcome,
    input::InputOptions,
    job,
    output::{print, write_whole},
    progress,
    report::Count,
};
use anyhow::{bail, ensure};
use child::{Child, Program};
use harvest::Drive;
use indicatif::ProgressBar;
use randt_config::{Config, Loaded, Selection, SelectionArguments};
use randt_imu::Imu;
use randt_radar::Radar;
use randt_readers::Source;
use randt_stage::{Realm, RealmArguments, Stage, Woken};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use watch::Watch;

/// How often children and the end are looked for where nothing else happens.
const LOOK: Duration = Duration::from_millis(100);
/// After the end of the log nothing more is to be expected when nothing has come for so long.
const QUIET: Duration = Duration::from_secs(2);
/// A stage that is not running after this time is told of.
const START_MAX: Duration = Duration::from_secs(10);

/// What stands in for the drivers.
const PLAY: &str = "play";

/// Refuses a configuration that a driver would end by.
pub fn check_drivers(loaded: &Loaded, no_imu: bool) -> anyhow::Result<()> {
    let mut config = loaded.config.clone();
    // Nothing is to be written yet.
    config.record.dense.clear();
    let origins = &loaded.origins;
    let radar = Radar::new(&config).map_err(|error| error.in_configuration(origins));
    radar.map_err(anyhow::Error::from_boxed)?;
    if !no_imu {
        Imu::new(&config).map_err(|error| error.in_configuration(origins))?;
    }
    Ok(())
}

/// The drivers, the one first whose data the other's wait for.
fn drivers(no_imu: bool) -> &'static [&'static str] {
    if no_imu {
        &["radar"]
    } else {
        &["imu", "radar"]
    }
}

/// Arguments of `randt up`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Play this recording to the pipeline instead of starting the drivers of the radar and the IMU
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
    realm: RealmArguments,
    #[command(flatten)]
    options: InputOptions,
}

/// Starts everything, watches it, ends it, and leaves the files.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let source = match &arguments.play {
        Some(log) => Some(randt_readers::open(log, &arguments.options.options())?),
        None => None,
    };
    let loaded = configuration(&arguments.selection, source.as_deref())?;
    if arguments.play.is_none() && !arguments.no_drivers {
        check_drivers(&loaded, arguments.no_imu)?;
    }
    crate::commands::run::prepare_folder(&arguments.out)?;
    let realm = arguments.realm.realm()?;
    harvest::set_aside(&arguments.out)?;
    if randt_stage::wipe(&realm, true)?.is_none() {
        bail!(
            "{}: a pipeline runs here already, or a stage of one; stop it, or give this one another --prefix (a recorder is started by --record, a view by --view)",
            realm.folder().display()
        );
    }
    let mut pipeline = Pipeline::start(&arguments, &realm, &loaded, source.as_deref())?;
    let ended = pipeline.watch();
    let stopped = pipeline.stop();
    let interrupted = ended?;
    stopped?;
    let drive = Drive {
        realm: &realm,
        out: &arguments.out,
        config: &loaded.config,
        use_imu: !arguments.no_imu,
        log: arguments.play.as_deref(),
        options: arguments.options.options(),
    };
    let (mut extra, begin) = (pipeline.watch.counters(), pipeline.begin);
    if interrupted && arguments.play.is_some() {
        let first = "the log was not played to its end".to_owned();
        extra.insert("interrupted", Count::lost(1, first));
    }
    drive.harvest(pipeline.watch.take_states(), extra, begin)
}

/// What is in force, with the mounting that the log says.
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

/// The running stages.
struct Pipeline {
    stage: Option<Stage>,
    watch: Watch,
    /// In the order of the data's way, which is the order in which they are ended.
    children: Vec<Child>,
    bar: ProgressBar,
    begin: Instant,
}

impl Pipeline {
    fn start(
        arguments: &Arguments,
        realm: &Realm,
        loaded: &Loaded,
        source: Option<&dyn Source>,
    ) -> anyhow::Result<Self> {
        let mut stage = Stage::open("up", realm)?;
        stage.expect(&loaded.config.sensor);
        let watch = Watch::open(&mut stage)?;
        stage.running()?;
        let profile = realm.folder().join("up.toml");
        write_profile(&profile, loaded)?;
        let bar = progress::bar(source.and_then(|source| source.info().scans), "scans");
        let mut pipeline = Self {
            stage: Some(stage),
            watch,
            children: Vec::new(),
            bar,
            begin: Instant::now(),
        };
        let journal = std::path::absolute(arguments.out.join(harvest::JOURNAL))?;
        if let Some(folder) = &arguments.record {
            let mut program = Program::stage("recorder", realm)?;
            program.option("--profile", &profile);
            program.option("--out", std::path::absolute(folder)?);
            pipeline.add(program);
        }
        if arguments.view {
            let mut program = Program::stage("view", realm)?;
            program.option("--profile", &profile);
            pipeline.add(program);
        }
        for name in ["mapper", "odometry", "filter"] {
            let mut program = Program::stage(name, realm)?;
            program.option("--profile", &profile);
            match name {
                "mapper" => program.option("--journal", &journal),
                "odometry" if arguments.no_imu => program.flag("--no-imu"),
                _ => {}
            }
            pipeline.add(program);
        }
        pipeline.wait_until_running()?;
        if let Some(log) = &arguments.play {
            let mut program = Program::command(PLAY, realm)?;
            program.flag(log);
            program.flag("--stay");
            program.option("--rate", arguments.rate.to_string());
            for argument in arguments.options.as_arguments() {
                program.flag(argument);
            }
            pipeline.add(program);
        } else if !arguments.no_drivers {
            for name in drivers(arguments.no_imu) {
                let mut program = Program::stage(name, realm)?;
                program.option("--profile", &profile);
                pipeline.add(program);
            }
        }
        Ok(pipeline)
    }

    /// Starts a program whose data go to those that were added before.
    fn add(&mut self, program: Program) {
        let child = Child::start(program, self.bar.clone());
        self.children.insert(0, child);
    }

    /// Waits until every stage says that it runs.
    fn wait_until_running(&mut self) -> anyhow::Result<()> {
        let give_up = Instant::now() + START_MAX;
        loop {
            self.look()?;
            let waiting: Vec<&str> = self
                .children
                .iter()
                .map(Child::name)
                .filter(|name| !self.watch.runs(name))
                .collect();
            if waiting.is_empty() {
                return Ok(());
            }
            ensure!(
                Instant::now() < give_up,
                "{} did not start within {START_MAX:?}",
                waiting.join(", ")
            );
            if self.wait()? == Woken::Stop {
                bail!("interrupted before the pipeline ran");
            }
        }
    }

    /// Watches until the log is computed or the end is asked for; gives whether it was asked for.
    fn watch(&mut self) -> anyhow::Result<bool> {
        loop {
            if self.wait()? == Woken::Stop {
                return Ok(true);
            }
            self.look()?;
            if self.play_has_ended() {
                return Ok(true);
            }
            self.bar.set_position(self.watch.scans());
            self.bar.set_message(self.watch.line());
            let quiet = self.watch.quiet_for() > QUIET;
            if self.watch.is_played() && (self.watch.is_computed() || quiet) {
                return Ok(false);
            }
        }
    }

    fn wait(&mut self) -> anyhow::Result<Woken> {
        let Some(stage) = &mut self.stage else {
            return Ok(Woken::Stop);
        };
        let woken = stage.wait(&self.watch.wakes(), Some(LOOK))?;
        self.watch.receive()?;
        Ok(woken)
    }

    /// Whether somebody ended the log before its end: what was computed until then is kept.
    fn play_has_ended(&self) -> bool {
        let mut children = self.children.iter();
        children.any(|child| child.name() == PLAY && child.given_up().is_some())
    }

    /// Whether a stage has given up, with its last words.
    fn look(&self) -> anyhow::Result<()> {
        let mut stages = self.children.iter().filter(|child| child.name() != PLAY);
        match stages.find_map(Child::given_up) {
            Some(why) => bail!(why),
            None => Ok(()),
        }
    }

    /// Ends the children along the data's way, so that each gets what the one before sent last.
    fn stop(&mut self) -> anyhow::Result<()> {
        for child in &mut self.children {
            child.stop();
            self.watch.receive()?;
        }
        self.bar.finish_and_clear();
        match self.stage.take() {
            Some(stage) => Ok(stage.close()?),
            None => Ok(()),
        }
    }
}

/// The configuration for the stages, exactly as it is in force here.
fn write_profile(path: &Path, loaded: &Loaded) -> anyhow::Result<()> {
    write_whole(path, loaded.to_toml().as_bytes())?;
    let read = Config::load(&Selection {
        profile: Some(path.display().to_string()),
        ..Selection::default()
    })?;
    ensure!(
        read.config == loaded.config,
        "{}: does not read back as it was written",
        path.display()
    );
    Ok(())
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // Where starting failed half way; a second stop does nothing.
        if let Err(error) = self.stop() {
            // Nobody is left to hand it to.
            let _ = print(&format!("{error}\n"));
        }
    }
}
