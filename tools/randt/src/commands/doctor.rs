//! `randt doctor`
use crate::exit::Outcome;
/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Arguments {}
/// Runs.
pub fn run(_: Arguments) -> anyhow::Result<Outcome> {
    Ok(Outcome::Good)
}
