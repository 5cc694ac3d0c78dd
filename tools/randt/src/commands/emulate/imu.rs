//! `randt emulate imu`.

use super::Common;
use crate::exit::Outcome;

/// Arguments of `randt emulate imu`.
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
