//! How a stage's process ends.

use crate::journal::{Priority, say_plainly};
use std::error::Error;
use std::process::ExitCode;

/// Tells why a stage failed, once, and gives its exit code: 0 good, 1 failed, 78 bad configuration.
pub fn ended(name: &str, result: Result<(), Box<dyn Error>>) -> ExitCode {
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    say_plainly(name, Priority::Error, &format!("error: {error}"));
    let configuration = error.is::<randt_config::Error>();
    ExitCode::from(if configuration { 78 } else { 1 })
}
