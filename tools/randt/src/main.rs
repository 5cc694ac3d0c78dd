//! `randt`: radar SLAM where cameras and LiDAR are blind.

use clap::Parser;
use std::process::ExitCode;

/// Radar SLAM for robots that work where cameras and LiDAR are blind: smoke, dust, fog.
#[derive(Debug, Parser)]
#[command(name = "randt", max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: randt::commands::Command,
}

fn main() -> ExitCode {
    let arguments: Arguments = randt_stage::parse();
    randt::exit::report(arguments.command.run())
}
