//! How a stage's process ends.

use std::error::Error;
use std::io::Write;
use std::process::ExitCode;

/// Tells why a stage failed, once, and gives its exit code: 0 good, 1 failed, 78 bad configuration.
pub fn ended(name: &str, result: Result<(), Box<dyn Error>>) -> ExitCode {
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    say(name, &format!("error: {error}"));
    let configuration = error.is::<randt_config::Error>();
    ExitCode::from(if configuration { 78 } else { 1 })
}

/// A line on standard error, for the journal. Where nobody reads it any more the stage goes on all the same.
pub(crate) fn say(name: &str, text: &str) {
    let _ = writeln!(std::io::stderr(), "randt-{name}: {text}");
}
