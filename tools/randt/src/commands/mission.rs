//! `randt mission`: drives of a robot, each with map, logs, configuration and report; one file for
//! each action.

mod boot;
mod copy;
mod delete;
mod export;
mod list;
mod logged;
mod new;
mod owner;
mod recover;
mod report;
mod stages;
mod stop;
mod target;

use crate::exit::Outcome;
use crate::identity::Identity;
use crate::missions::{Missions, ROOT};
use std::path::PathBuf;

/// Arguments of `randt mission`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the missions
    #[arg(long, value_name = "DIR", default_value = ROOT, global = true)]
    root: PathBuf,
    #[command(subcommand)]
    action: Action,
}

/// What to do.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Begin a new mission with an empty map; the one before is stopped
    New(new::Arguments),
    /// End the mission: the pipeline stops, the report is written, and the next start begins a new
    /// one
    Stop(stop::Arguments),
    /// List the missions
    List(list::Arguments),
    /// Copy a mission somewhere else, with whole logs and its report
    Export(export::Arguments),
    /// Remove a mission with its map, logs and report
    Delete(delete::Arguments),
    /// Decide at the robot's start whether the last mission goes on (systemd calls this)
    Boot(boot::Arguments),
    /// Make whole logs of those that a power cut left, and records that cannot be read anew
    /// (systemd calls this)
    Recover,
}

/// Does it, as root with the rights of no matter who owns the missions.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let owner = Identity::of_way_to(&arguments.root)?;
    owner.run(|| act(arguments))
}

fn act(arguments: Arguments) -> anyhow::Result<Outcome> {
    let missions = Missions::open(&arguments.root)?;
    match arguments.action {
        Action::New(arguments) => new::run(&missions, &arguments),
        Action::Stop(arguments) => stop::run(&missions, &arguments),
        Action::List(arguments) => list::run(&missions, &arguments),
        Action::Export(arguments) => export::run(&missions, &arguments),
        Action::Delete(arguments) => delete::run(&missions, &arguments),
        Action::Boot(arguments) => boot::run(&missions, &arguments),
        Action::Recover => recover::run(&missions),
    }
}
