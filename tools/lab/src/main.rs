//! `randt-lab`: what research needs beside `randt`.

use clap::Parser;
use randt::help;
use randt_lab::{Command, EXAMPLES, GROUPS};
use std::process::ExitCode;

/// The research bench of randt: accuracy, what each part of the method is worth, the solver,
/// sensors.
#[derive(Debug, Parser)]
#[command(name = "randt-lab", max_term_width = 100)]
#[command(help_template = help::template::<Command>(GROUPS), after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let arguments: Arguments = randt_stage::parse();
    randt::exit::exit_code(arguments.command.run())
}
