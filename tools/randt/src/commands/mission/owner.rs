//! Whose state it is that the stages left in the run folder.

use crate::mission::Mission;
use crate::missions::Missions;
use crate::output::{warn, write_private};
use crate::plain_file;
use randt_stage::{Domain, wipe};
use std::path::PathBuf;

/// In the run folder: the mission's name.
const OWNER: &str = "mission";

/// Whether the pipeline of a run folder writes into a mission.
pub fn owns(mission: &Mission, domain: &Domain) -> bool {
    let owner = plain_file::read_to_string(&domain.folder().join(OWNER));
    owner.is_ok_and(|owner| owner == mission.name())
}

/// Gives the run folder to a mission. What stages of another one left there would make this one go
/// on where that was: it is taken away, into the other one's folder where it has no report yet.
pub fn hand_to(mission: &Mission, missions: &Missions, domain: &Domain) -> anyhow::Result<()> {
    if owns(mission, domain) {
        return Ok(());
    }
    let path = domain.folder().join(OWNER);
    let before = plain_file::read_to_string(&path).ok();
    if let Some(before) = before.and_then(|name| missions.get(&name).ok())
        && !before.has_report()
        && let Err(error) = before.keep_state(&domain.state())
    {
        // Its logs have what makes it again.
        warn(&format!("{}: {error:#}", before.name()));
    }
    wipe(domain, true)?;
    write_private(&path, mission.name().as_bytes())
}

/// Where odometry's last state of a mission is, if anywhere.
pub fn state_of(mission: &Mission, domain: &Domain) -> Option<PathBuf> {
    let in_memory = || owns(mission, domain).then(|| domain.state());
    mission.kept_state().or_else(in_memory)
}
