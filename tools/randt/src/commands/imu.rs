//! `randt imu`.

use crate::exit::Outcome;

/// Arguments of `randt imu`.
#[derive(Debug, clap::Args)]
pub struct Arguments {}

/// Not written yet.
pub fn run(_arguments: Arguments) -> anyhow::Result<Outcome> {
    anyhow::bail!("not written yet")
}
