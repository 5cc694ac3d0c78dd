//! `randt config`: which values are in force, and whether a file is good.

use crate::exit::Outcome;
use crate::output::print;
use randt_config::{Error, SelectionArguments, check_file};

/// What to do.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
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
pub fn run(action: Action) -> anyhow::Result<Outcome> {
    match action {
        Action::Show(selection) => print(&selection.load(None)?.to_toml())?,
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
