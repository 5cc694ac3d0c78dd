//! One file per command: its arguments, what it does, what it prints.

mod ablation;
mod bench;
mod eval;
mod graph;
mod imu;
mod register;

use clap::Subcommand;
use randt::exit::Outcome;
use randt::help::Group;

/// The commands by what they serve, as `--help` lists them.
pub const GROUPS: &[Group] = &[
    ("Accuracy", &["eval", "ablation", "bench"]),
    ("Parts of the method", &["register", "graph"]),
    ("Sensors", &["imu"]),
];

/// What `--help` ends with.
pub const EXAMPLES: &str = "\
Examples:
  randt-lab eval OUT/trajectory.tum TRUTH.tum --loops OUT/report.json
  randt-lab ablation --seeds 3
  randt-lab bench trust --against docs/trust-bench.csv
  randt-lab graph CSAIL.g2o --false-loops 30
  randt-lab imu IMU.csv --attitude ATTITUDE.tum

`randt-lab COMMAND --help` lists a command's options.";

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Compare a trajectory with the truth
    Eval(eval::Arguments),
    /// Measure what the parts of the method are worth
    ///
    /// One part after the other is left out, on drives through the built-in worlds. Each drive is
    /// simulated in memory and computed seven times. Without options this takes about a minute, at
    /// most three on a small machine, and half a gigabyte of memory; each further seed takes the
    /// same time again. All figures but the times are the same in every run.
    Ablation(ablation::Arguments),
    /// Measure over worlds, seeds and faults whether trust can be trusted
    Bench(bench::Arguments),
    /// Register two radar scans to each other
    Register(register::Arguments),
    /// Solve a pose graph in g2o's format, as it is or with false loops
    Graph(graph::Arguments),
    /// Examine an IMU recording: biases, standstills, mounting, attitude
    Imu(imu::Arguments),
}

impl Command {
    /// Runs the command.
    pub fn run(self) -> anyhow::Result<Outcome> {
        match self {
            Self::Eval(arguments) => eval::run(arguments),
            Self::Ablation(arguments) => ablation::run(arguments),
            Self::Bench(arguments) => bench::run(arguments),
            Self::Register(arguments) => register::run(arguments),
            Self::Graph(arguments) => graph::run(arguments),
            Self::Imu(arguments) => imu::run(arguments),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt::help;

    #[test]
    fn every_command_is_in_one_group_and_the_page_fits_a_terminal() {
        assert_eq!(help::misplaced::<Command>(GROUPS), [""; 0]);
        let page = help::template::<Command>(GROUPS) + EXAMPLES;
        for line in page.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
