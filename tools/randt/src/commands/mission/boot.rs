//! `randt mission boot`: before the stages start.

use super::{owner, recover};
use crate::date::Now;
use crate::exit::Outcome;
use crate::mission::{CONFIGURATION, Mission};
use crate::missions::Missions;
use crate::output::{print, write_whole};
use crate::units::seconds;
use randt_config::SelectionArguments;
use randt_stage::{DomainArguments, wipe};

/// Arguments of `randt mission boot`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    domain: DomainArguments,
}

/// Goes on with the last mission where it was interrupted a short while ago, else begins a new
/// one.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let domain = arguments.domain.domain()?;
    let _lock = missions.lock()?;
    if wipe(&domain, false)?.is_none() {
        return print("the stages run already: the mission is what it is\n")
            .map(|()| Outcome::Good);
    }
    let now = Now::read();
    // Whatever has become of the last one, the robot can drive.
    let (mission, how) = match missions.current_or_none() {
        Some(mut mission) => {
            mission.repair()?;
            recover::mark_cut_logs(&mission)?;
            if mission.goes_on(&now) {
                mission.resume(&now, owner::owns(&mission, &domain))?;
                (mission, "goes on".to_owned())
            } else {
                let how = format!("begins: {}", why_not(&mission, &now));
                (missions.begin(None, &now)?, how)
            }
        }
        None => (missions.begin(None, &now)?, "begins".to_owned()),
    };
    owner::hand_to(&mission, missions, &domain)?;
    // Each stage that a wrong configuration stops reports it.
    if let Ok(loaded) = arguments.selection.load(None) {
        let path = mission.folder().join(CONFIGURATION);
        write_whole(&path, loaded.to_toml().as_bytes())?;
    }
    print(&format!("{}: {how}\n", mission.name()))?;
    Ok(Outcome::Good)
}

/// Why a mission does not go on.
fn why_not(mission: &Mission, now: &Now) -> String {
    let name = mission.name();
    match (mission.record.stopped_ns, mission.silent_ns(now)) {
        (Some(_), _) => format!("{name} was stopped"),
        (None, Some(ns)) => format!("{name} was interrupted {} ago", seconds(ns as f64 * 1e-9)),
        (None, None) => {
            format!("{name} was interrupted, and without a date the time since then is unknown")
        }
    }
}
