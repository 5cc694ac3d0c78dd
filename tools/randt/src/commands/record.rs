//! `randt record`: the recorder in the foreground.

use crate::exit::Outcome;
use anyhow::{Context, ensure};
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Arguments of `randt record`.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Arguments {
    /// Options of randt-recorder: --out DIR, --prefix NAME, --set KEY=VALUE ...; --help lists them
    /// all
    #[arg(
        value_name = "OPTIONS",
        trailing_var_arg = true,
        allow_hyphen_values = true
    )]
    options: Vec<OsString>,
}

/// Becomes the recorder, which stands beside this program.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let this = std::env::current_exe().context("this program's own path")?;
    let path = this.with_file_name("randt-recorder");
    ensure!(
        path.is_file(),
        "{}: not there; the stages stand beside randt itself (cargo build makes them all)",
        path.display()
    );
    let failed = Command::new(&path).args(&arguments.options).exec();
    Err(failed).with_context(|| format!("{}: cannot be started", path.display()))
}
