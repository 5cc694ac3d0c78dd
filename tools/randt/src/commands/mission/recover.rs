//! `randt mission recover`: whole logs of those that were cut, and records of missions that cannot
//! be read.
//!
//! A cut log is renamed before the recorder begins, and repaired while the pipeline runs: that
//! takes seconds.

use crate::commands::log::recover as log;
use crate::exit::Outcome;
use crate::mission::Mission;
use crate::missions::Missions;
use crate::output::warn;
use anyhow::Context;
use std::fs;

/// The name's end of a log that nobody writes any more.
const CUT: &str = "cut";
/// The same while the recorder writes it.
const ACTIVE: &str = "active";

/// Repairs the missions, each as far as it can be repaired.
pub fn run(missions: &Missions) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome::Good;
    for mut mission in missions.all()? {
        let repaired = {
            let _lock = missions.lock()?;
            mission.repair()
        };
        let repaired = repaired.and_then(|()| repair_logs(&mission));
        if let Err(error) = repaired {
            warn(&format!("{}: {error:#}", mission.name()));
            outcome = Outcome::Failed;
        }
    }
    Ok(outcome)
}

/// Gives a mission's unfinished logs another name. Only where no recorder runs.
pub fn mark_cut_logs(mission: &Mission) -> anyhow::Result<()> {
    for active in mission.log_files()? {
        if active.extension().is_some_and(|ending| ending == ACTIVE) {
            let cut = active.with_extension(CUT);
            fs::rename(&active, &cut).with_context(|| active.display().to_string())?;
        }
    }
    Ok(())
}

/// Makes whole logs of the cut ones. One that holds nothing whole stays as it is, with a warning.
pub fn repair_logs(mission: &Mission) -> anyhow::Result<()> {
    let logs = mission.logs();
    // A mission that never recorded has no such folder.
    let Ok(folder) = fs::File::open(&logs) else {
        return Ok(());
    };
    // Two that repair the same log would write over each other.
    folder.lock().with_context(|| logs.display().to_string())?;
    for cut in mission.log_files()? {
        if cut.extension().is_none_or(|ending| ending != CUT) {
            continue;
        }
        let whole = cut.with_extension("");
        // An earlier attempt may have been cut after it was done.
        match log::recover(&cut, &whole, true) {
            Ok(_) => fs::remove_file(&cut).with_context(|| cut.display().to_string())?,
            Err(error) => warn(&format!("{}: stays as it is: {error:#}", cut.display())),
        }
    }
    Ok(())
}
