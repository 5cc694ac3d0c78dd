//! `randt mission new`: an empty map.

use super::{now_ns, stop, target};
use crate::exit::Outcome;
use crate::missions::Missions;
use crate::output::print;

/// Arguments of `randt mission new`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Its name; if not given, the date
    name: Option<String>,
}

/// Ends the current mission, begins another, and starts the pipeline again where it ran.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let name = arguments.name.as_deref();
    if let Some(name) = name {
        // Before anything is stopped.
        missions.check_free(name)?;
    }
    let ran = target::stop()?;
    if let Some(mission) = missions.current() {
        stop::end(missions, mission)?;
    }
    let mission = missions.begin(name, now_ns())?;
    print(&format!("{}: begins\n", mission.name()))?;
    if ran {
        target::start()?;
    }
    Ok(Outcome::Good)
}
