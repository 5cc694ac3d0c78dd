//! `randt mission stop`: the end of a drive.

use super::{now_ns, recover, report, target};
use crate::exit::Outcome;
use crate::mission::{Mission, REPORT};
use crate::missions::Missions;
use crate::output::print;
use anyhow::Context;

/// Stops the pipeline and ends the current mission.
pub fn run(missions: &Missions) -> anyhow::Result<Outcome> {
    target::stop()?;
    let mission = missions.current();
    let mission = mission.context("there is no mission; the pipeline's start begins one")?;
    if mission.record.stopped_ns.is_some() {
        print(&format!("{}: was stopped before\n", mission.name()))?;
        return Ok(Outcome::Good);
    }
    end(missions, mission)?;
    Ok(Outcome::Good)
}

/// Ends a mission: whole logs, report, a note. One that has nothing to report is no failure.
pub fn end(missions: &Missions, mut mission: Mission) -> anyhow::Result<()> {
    if mission.record.stopped_ns.is_some() {
        return Ok(());
    }
    // First, so that it does not go on whatever comes.
    mission.stop(now_ns())?;
    recover::set_aside(&mission)?;
    recover::mend(&mission.logs())?;
    let folder = mission.folder().join(REPORT);
    if let Err(error) = report::write(&mission, &mission.name(), &folder) {
        eprintln!("{}: no report: {error:#}", mission.name());
    }
    missions.hand_over(mission.folder())?;
    print(&format!("{}: is stopped\n", mission.name()))
}
