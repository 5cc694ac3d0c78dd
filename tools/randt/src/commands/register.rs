//! `randt register`.

use crate::exit::Outcome;

/// Arguments of `randt register`.
#[derive(Debug, clap::Args)]
pub struct Arguments {}

/// Not written yet.
pub fn run(_arguments: Arguments) -> anyhow::Result<Outcome> {
    anyhow::bail!("not written yet")
}
