//! `randt mission recover`: whole logs of those that were cut.
//!
//! A cut log is set aside before the recorder begins, and mended while the pipeline runs: that takes seconds.

use crate::commands::log::recover as log;
use crate::exit::Outcome;
use crate::mission::Mission;
use crate::missions::Missions;
use anyhow::Context;
use std::fs;
use std::path::Path;

/// The name's end of a log that nobody writes any more.
const CUT: &str = "cut";
/// The same while the recorder writes it.
const ACTIVE: &str = "active";

/// Mends the logs of all missions.
pub fn run(missions: &Missions) -> anyhow::Result<Outcome> {
    for mission in missions.all()? {
        mend(&mission.logs())?;
    }
    Ok(Outcome::Good)
}

/// Gives a mission's unfinished logs another name. Only where no recorder runs.
pub fn set_aside(mission: &Mission) -> anyhow::Result<()> {
    for active in mission.log_files()? {
        if active.extension().is_some_and(|ending| ending == ACTIVE) {
            let cut = active.with_extension(CUT);
            fs::rename(&active, &cut).with_context(|| active.display().to_string())?;
        }
    }
    Ok(())
}

/// Makes whole logs of those that were set aside. One that holds nothing whole stays as it is, and is told of.
pub fn mend(logs: &Path) -> anyhow::Result<()> {
    let found = match fs::read_dir(logs) {
        Ok(found) => found,
        // A mission that never recorded.
        Err(_) => return Ok(()),
    };
    for cut in found.flatten().map(|entry| entry.path()) {
        if cut.extension().is_none_or(|ending| ending != CUT) {
            continue;
        }
        let whole = cut.with_extension("");
        // An earlier attempt may have been cut after it was done.
        match log::recover(&cut, &whole, true) {
            Ok(_) => fs::remove_file(&cut).with_context(|| cut.display().to_string())?,
            Err(error) => eprintln!("{}: stays as it is: {error:#}", cut.display()),
        }
    }
    Ok(())
}
