//! `randt`: radar SLAM where cameras and LiDAR are blind.

use randt::commands::Arguments;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Arguments = randt_stage::parse();
    randt::exit::exit_code(arguments.command.run())
}
