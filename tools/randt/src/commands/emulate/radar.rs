//! `randt emulate radar`.

use super::Common;
use crate::exit::Outcome;

/// Arguments of `randt emulate radar`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
}

/// Emulates.
pub fn run(arguments: Arguments) -> anyhow::Result<Outcome> {
    let _ = arguments.common.begin();
    anyhow::bail!("not there yet")
}
