//! `randt`: radar SLAM where cameras and LiDAR are blind.

use clap::Parser;
use randt::commands::{Command, EXAMPLES, GROUPS};
use randt::help;
use std::process::ExitCode;

/// Radar SLAM for robots that work where cameras and LiDAR are blind: smoke, dust, fog.
#[derive(Debug, Parser)]
#[command(name = "randt", max_term_width = 100)]
#[command(help_template = help::template::<Command>(GROUPS), after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let arguments: Arguments = randt_stage::parse();
    randt::exit::exit_code(arguments.command.run())
}
