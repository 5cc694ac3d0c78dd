//! One file per command: its arguments, what it does, what it prints.

mod bench;
mod calibrate;
mod config;
mod demo;
mod doctor;
mod emulate;
mod eval;
mod graph;
mod import;
mod imu;
mod log;
mod mission;
mod play;
mod plot;
mod record;
mod register;
mod run;
mod simulate;
mod top;
mod up;

use crate::exit::Outcome;
use clap::Subcommand;

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a drive through a building, run the pipeline on it and show how exact it is
    Demo(demo::Arguments),
    /// Compute the trajectory of a recorded radar log
    Run(run::Arguments),
    /// Compare a trajectory with the truth
    Eval(eval::Arguments),
    /// Simulate a drive and write it as a log
    Simulate(simulate::Arguments),
    /// Turn a recording of another format into our log
    Import(import::Arguments),
    /// Run the whole pipeline as processes, restarting what dies, and leave what `randt run` leaves
    Up(up::Arguments),
    /// Publish a recording to the pipeline as the drivers would
    Play(play::Arguments),
    /// Record every topic of the pipeline until Ctrl-C
    Record(record::Arguments),
    /// Look into a log, check it, recover it, cut it, export it
    Log(log::Arguments),
    /// Begin, end, list and take away a robot's missions
    Mission(mission::Arguments),
    /// Draw what is in a log: path and map, motion, quality, latency, topics, biases
    Plot(plot::Arguments),
    /// Stand in for sensors that are not there, in their own protocols
    Emulate(emulate::Arguments),
    /// Watch the pipeline: stages, topics, latency, pose and map
    Top(top::Arguments),
    /// Find out what is wrong with the pipeline and say what mends it
    Doctor(doctor::Arguments),
    /// Examine an IMU recording: biases, standstills, mounting, attitude
    Imu(imu::Arguments),
    /// Find out where the radar sits on the robot, and how late its stamps are
    Calibrate(calibrate::Arguments),
    /// Register two radar scans to each other
    Register(register::Arguments),
    /// Solve a pose graph in g2o's format, as it is or with false loops added
    Graph(graph::Arguments),
    /// Measure what the parts of the method are worth
    Bench(bench::Arguments),
    /// Show or check a configuration
    Config(config::Arguments),
}

impl Command {
    /// Runs the command.
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self {
            Self::Demo(arguments) => demo::run(arguments),
            Self::Run(arguments) => run::run(arguments),
            Self::Eval(arguments) => eval::run(arguments),
            Self::Simulate(arguments) => simulate::run(arguments),
            Self::Import(arguments) => import::run(arguments),
            Self::Up(arguments) => up::run(arguments),
            Self::Play(arguments) => play::run(arguments),
            Self::Record(arguments) => record::run(&arguments),
            Self::Log(arguments) => log::run(arguments),
            Self::Mission(arguments) => mission::run(arguments),
            Self::Plot(arguments) => plot::run(&arguments),
            Self::Emulate(arguments) => emulate::run(arguments),
            Self::Top(arguments) => top::run(arguments),
            Self::Doctor(arguments) => doctor::run(arguments),
            Self::Imu(arguments) => imu::run(arguments),
            Self::Calibrate(arguments) => calibrate::run(arguments),
            Self::Register(arguments) => register::run(arguments),
            Self::Graph(arguments) => graph::run(arguments),
            Self::Bench(arguments) => bench::run(arguments),
            Self::Config(arguments) => config::run(arguments),
        }
    }
}
