//! `randt-link`: a robot's topics on another machine's bus, as a process at each end.

mod base;
mod bucket;
mod cargo;
mod carrier;
mod clock_offset;
mod flow;
mod frame;
mod journal;
mod keys;
mod link;
mod newest;
mod peer;
mod ports;
mod robot;
mod session;
mod settings;
mod status;
mod stream;

use clap::{Parser, Subcommand};
use randt_config::Error as ConfigError;
use randt_stage::{StageArguments, ended, parse};
use settings::Settings;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

/// The link: topics of a robot's bus on a base's bus, over a bad radio.
///
/// What is carried, and how fast, is in the configuration's section `link`. At the base each robot
/// has a process and a pipeline (`--prefix`) of its own.
#[derive(Debug, Parser)]
#[command(
    name = "randt-link",
    max_term_width = 100,
    args_conflicts_with_subcommands = true
)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Where the robot keeps its keyframes for the base, on a disk; if not given, in the run
    /// folder, where it survives the stage but not the machine
    #[arg(long, value_name = "FILE")]
    journal: Option<PathBuf>,
    #[command(flatten)]
    stage: StageArguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Makes the keys of one end in DIR/NAME, which is to be copied to that machine (link.keys)
    ///
    /// DIR/authority.key signs them: it stays with the operator. The base's name is "base", a
    /// robot's is link.robot.
    Keys {
        /// Folder of all keys; made if it is not there
        dir: PathBuf,
        /// Whose keys
        name: String,
        /// How long they hold
        #[arg(long, value_name = "DAYS", default_value_t = 730)]
        days: i64,
    },
}

fn main() -> ExitCode {
    ended("link", run(&parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if let Some(Command::Keys { dir, name, days }) = &arguments.command {
        return Ok(keys::make(dir, name, *days).map_err(|why| format!("{why:#}"))?);
    }
    let loaded = arguments.stage.selection.load(None)?;
    let config = loaded.config;
    let settings = Settings::new(&config.link).map_err(|wrong| {
        ConfigError::value(
            &loaded.origins,
            ("link", wrong.key),
            &wrong.found,
            wrong.expected,
        )
    })?;
    let name = if settings.is_base {
        "link-base"
    } else {
        "link"
    };
    let mut stage = arguments.stage.open(name)?;
    stage.expect_sensor(&config.sensor);
    let selection = &arguments.stage.selection;
    stage.follow_configuration(selection, &config, &["link"], None);
    let in_run_folder = || stage.domain().state().join("link.journal");
    let journal = arguments.journal.clone().unwrap_or_else(in_run_folder);
    link::run(&mut stage, &config, &settings, &journal)?;
    Ok(stage.close()?)
}
