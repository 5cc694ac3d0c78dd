//! Exit codes: 0 good, 1 failed, 2 wrong usage (clap), 3 finished but data were lost, 78 bad configuration.

use std::process::ExitCode;

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All good.
    Good,
    /// Ran to its end and says no (a check that does not hold).
    Failed,
    /// Finished, but data were lost.
    DataLost,
}

/// Prints an error with its causes and gives the process's exit code.
pub fn report(result: anyhow::Result<Outcome>) -> ExitCode {
    match result {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::DataLost) => ExitCode::from(3),
        Err(error) => {
            eprintln!("error: {error:#}");
            let configuration = error.chain().any(|cause| cause.is::<randt_config::Error>());
            ExitCode::from(if configuration { 78 } else { 1 })
        }
    }
}
