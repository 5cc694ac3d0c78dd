//! `randt mission stop`: the end of a drive.

use super::{owner, recover, report, stages};
use crate::date::Now;
use crate::exit::Outcome;
use crate::mission::{Mission, REPORT};
use crate::missions::Missions;
use crate::output::{print, warn};
use anyhow::Context;
use randt_stage::{Domain, DomainArguments};

/// Arguments of `randt mission stop`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    domain: DomainArguments,
}

/// Stops the pipeline and ends the current mission.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let domain = arguments.domain.domain()?;
    let _lock = missions.lock()?;
    let mission = missions.current()?;
    let mission = mission.context("there is no mission; the pipeline's start begins one")?;
    stages::stop(&mission, &domain)?;
    if mission.record.stopped_ns.is_some() {
        print(&format!("{}: was stopped before\n", mission.name()))?;
        return Ok(Outcome::Good);
    }
    end(missions, mission, &domain)
}

/// Ends a mission whose stages have ended: whole logs, report, its record. One that has nothing to
/// report is no failure.
pub fn end(missions: &Missions, mut mission: Mission, domain: &Domain) -> anyhow::Result<Outcome> {
    if mission.record.stopped_ns.is_some() {
        return Ok(Outcome::Good);
    }
    // First, so that it does not go on, even if what follows fails.
    mission.stop(missions.date_ns(&Now::read())?)?;
    recover::mark_cut_logs(&mission)?;
    recover::repair_logs(&mission)?;
    let state = owner::state_of(&mission, domain);
    let folder = mission.folder().join(REPORT);
    let written = report::write(&mission, &mission.name(), state.as_deref(), &folder);
    let outcome = match written {
        Ok(lost) => {
            mission.drop_state()?;
            Outcome::finished(lost)
        }
        Err(error) => {
            warn(&format!("{}: no report: {error:#}", mission.name()));
            Outcome::Good
        }
    };
    print(&format!("{}: is stopped\n", mission.name()))?;
    Ok(outcome)
}
