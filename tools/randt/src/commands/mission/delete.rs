//! `randt mission delete`: a mission that nobody needs any more.

use crate::exit::Outcome;
use crate::missions::Missions;
use crate::output::print;
use crate::units::bytes;
use std::fs;

/// Arguments of `randt mission delete`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Its name; not the current one
    name: String,
}

/// Removes it with its map, logs and report.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let _lock = missions.lock()?;
    let mission = missions.get(&arguments.name)?;
    let logs = mission.log_files()?;
    let sizes = logs.iter().filter_map(|file| fs::metadata(file).ok());
    let size: u64 = sizes.map(|found| found.len()).sum();
    missions.delete(&mission)?;
    print(&format!(
        "{}: is deleted, with {} of logs\n",
        mission.name(),
        bytes(size)
    ))?;
    Ok(Outcome::Good)
}
