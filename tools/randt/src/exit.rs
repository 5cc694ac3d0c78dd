//! Exit codes: 0 good, 1 failed, 2 wrong usage (clap), 3 finished but data were lost, 78 bad
//! configuration.

use std::process::ExitCode;

/// The exit code of a wrong configuration: EX_CONFIG of sysexits.h.
pub const BAD_CONFIGURATION: i32 = 78;

/// A stage has refused its configuration, in its own text.
#[derive(Debug)]
pub struct Refused(pub String);

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refused {}

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All good.
    Good,
    /// Ran to its end, and the answer is no (a check that does not hold).
    Failed,
    /// Finished, but data were lost.
    DataLost,
}

impl Outcome {
    /// Of what has finished: good, unless data were lost.
    pub fn finished(lost: bool) -> Self {
        if lost { Self::DataLost } else { Self::Good }
    }
}

/// Prints an error with its causes and gives the process's exit code.
pub fn exit_code(result: anyhow::Result<Outcome>) -> ExitCode {
    ExitCode::from(status(result))
}

/// The same as a number.
pub fn status(result: anyhow::Result<Outcome>) -> u8 {
    match result {
        Ok(Outcome::Good) => 0,
        Ok(Outcome::Failed) => 1,
        Ok(Outcome::DataLost) => 3,
        Err(error) => {
            eprintln!("error: {}", text(&error));
            let is_of = |cause: &(dyn std::error::Error + 'static)| {
                cause.is::<randt_config::Error>() || cause.is::<Refused>()
            };
            let configuration = error.chain().any(is_of);
            if configuration {
                BAD_CONFIGURATION as u8
            } else {
                1
            }
        }
    }
}

/// The error and its causes in one line; a cause that a text above already contains is not
/// repeated.
fn text(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_cause_is_printed_once() {
        let error = anyhow::anyhow!("disk full")
            .context("log.mcap: disk full")
            .context("run");
        assert_eq!(super::text(&error), "run: log.mcap: disk full");
    }
}
