//! `randt mission new`: an empty map.

use super::{stages, stop, target};
use crate::date::Now;
use crate::exit::Outcome;
use crate::missions::Missions;
use crate::output::print;
use randt_stage::DomainArguments;

/// Arguments of `randt mission new`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Its name; if not given, the date
    name: Option<String>,
    #[command(flatten)]
    domain: DomainArguments,
}

/// Ends the current mission, begins another, and starts the pipeline again where it ran under
/// systemd.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let name = arguments.name.as_deref();
    let domain = arguments.domain.domain()?;
    let mut outcome = Outcome::Good;
    let ran;
    {
        let _lock = missions.lock()?;
        if let Some(name) = name {
            // Before anything is stopped.
            missions.check_free(name)?;
        }
        ran = match missions.current_or_none() {
            Some(mission) => {
                let ran = stages::stop(&mission, &domain)?;
                outcome = stop::end(missions, mission, &domain)?;
                ran
            }
            None => target::stop()?,
        };
        let mission = missions.begin(name, &Now::read())?;
        print(&format!("{}: begins\n", mission.name()))?;
    }
    if ran {
        // Its first unit is `randt mission boot`, which takes the lock.
        target::start()?;
    }
    Ok(outcome)
}
