//! One file per command: its arguments, what it does, what it prints.

mod calibrate;
mod config;
mod demo;
mod doctor;
mod emulate;
mod import;
pub mod layout;
mod log;
mod mission;
mod play;
mod plot;
mod record;
mod run;
mod simulate;
mod top;
mod up;

use crate::exit::Outcome;
use crate::help::{self, Group};
use clap::{Parser, Subcommand};

/// The commands by what they serve, as `--help` lists them.
pub const GROUPS: &[Group] = &[
    ("Run and watch", &["demo", "run", "up", "top"]),
    ("Recordings", &["record", "log", "plot", "play", "import"]),
    ("Missions", &["mission"]),
    ("Check and calibrate", &["doctor", "config", "calibrate"]),
    ("Without a robot", &["simulate", "emulate"]),
    ("Programs of your own", &["layout"]),
];

/// What `--help` ends with.
pub const EXAMPLES: &str = "\
Examples:
  randt demo
  randt run DRIVE.bag --out RESULTS
  randt up --record LOGS --view
  randt log info LOGS/*.mcap
  randt doctor

`randt COMMAND --help` lists a command's options. What research needs (accuracy,
ablation, scan registration, pose graphs, IMU recordings) is in randt-lab.";

/// Radar SLAM for robots that work where cameras and LiDAR are blind: smoke, dust, fog.
#[derive(Debug, Parser)]
#[command(name = "randt", max_term_width = 100)]
#[command(help_template = help::template::<Command>(GROUPS), after_help = EXAMPLES)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a drive, compute it and show how exact that is
    Demo(demo::Arguments),
    /// Compute trajectory and map of a recording
    Run(run::Arguments),
    /// Simulate a drive and write it as a log
    Simulate(simulate::Arguments),
    /// Convert a recording of another format to our log
    Import(import::Arguments),
    /// Run the whole pipeline live, restarting the stages that die
    ///
    /// Every stage is a process. At the end the folder has the files that `randt run` leaves.
    Up(up::Arguments),
    /// Publish a recording to the pipeline as the drivers would
    Play(play::Arguments),
    /// Record every topic of the pipeline until Ctrl-C
    Record(record::Arguments),
    /// Inspect, check, recover, cut or export a log
    #[command(subcommand)]
    Log(log::Action),
    /// Begin, end, list and export a robot's missions
    Mission(mission::Arguments),
    /// Draw a log: path and map, motion, quality, latency, topics, biases
    Plot(plot::Arguments),
    /// Stand in for absent sensors, in their own protocols
    #[command(subcommand)]
    Emulate(emulate::Sensor),
    /// Watch the pipeline: stages, topics, latency, pose and map
    Top(top::Arguments),
    /// Find what is wrong with the pipeline, and the commands that fix it
    Doctor(doctor::Arguments),
    /// Estimate where the radar sits, and how late its stamps are
    #[command(subcommand)]
    Calibrate(calibrate::What),
    /// Print the messages of the bus for a program in Python, C or Rust
    Layout(layout::Arguments),
    /// Show or check a configuration
    #[command(subcommand)]
    Config(config::Action),
}

impl Command {
    /// Runs the command.
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self {
            Self::Demo(arguments) => demo::run(arguments),
            Self::Run(arguments) => run::run(arguments),
            Self::Simulate(arguments) => simulate::run(arguments),
            Self::Import(arguments) => import::run(arguments),
            Self::Up(arguments) => up::run(arguments),
            Self::Play(arguments) => play::run(arguments),
            Self::Record(arguments) => record::run(&arguments),
            Self::Log(action) => log::run(action),
            Self::Mission(arguments) => mission::run(arguments),
            Self::Plot(arguments) => plot::run(&arguments),
            Self::Emulate(sensor) => emulate::run(sensor),
            Self::Top(arguments) => top::run(arguments),
            Self::Doctor(arguments) => doctor::run(arguments),
            Self::Calibrate(what) => calibrate::run(what),
            Self::Layout(arguments) => layout::run(arguments),
            Self::Config(action) => config::run(action),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group_and_the_page_fits_a_terminal() {
        assert_eq!(help::misplaced::<Command>(GROUPS), [""; 0]);
        let page = help::template::<Command>(GROUPS) + EXAMPLES;
        for line in page.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
