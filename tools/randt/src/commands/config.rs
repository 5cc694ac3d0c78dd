//! `randt config`: which values are in force, and whether a file is good.

use crate::exit::Outcome;
use crate::output::print;
use randt_config::{Error, SelectionArguments, check_file};

/// Arguments of `randt config`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

/// What to do.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Print every key that is in force, what it means and where its value comes from
    ///
    /// The output is TOML and can be changed and given to --profile.
    Show(SelectionArguments),
    /// Check files (profiles, sensors, robots) and list every mistake
    Check {
        /// Files to check
        #[arg(required = true, value_name = "FILE")]
        files: Vec<String>,
    },
}

/// Shows or checks.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    match arguments.action {
        Action::Show(selection) => {
            print(&selection.load(None)?.to_toml())?;
        }
        Action::Check { files } => {
            let mut mistakes = Vec::new();
            for file in &files {
                match check_file(file) {
                    Ok(()) => print(&format!("{file}: good\n"))?,
                    Err(Error::Several(several)) => mistakes.extend(several),
                    Err(mistake) => mistakes.push(mistake),
                }
            }
            Error::all(mistakes)?;
        }
    }
    Ok(Outcome::Good)
}
