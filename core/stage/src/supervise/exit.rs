//! How a stage's process ends.

use super::journal::{Priority, log_to_stderr};
use std::error::Error;
use std::process::ExitCode;

/// Logs why a stage failed, once, and returns its exit code: 0 good, 1 failed, 78 bad
/// configuration.
pub fn ended(name: &str, result: Result<(), Box<dyn Error>>) -> ExitCode {
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    log_to_stderr(name, Priority::Error, &format!("error: {error}"));
    let configuration = error.is::<randt_config::Error>();
    ExitCode::from(if configuration { 78 } else { 1 })
}
