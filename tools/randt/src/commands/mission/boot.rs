//! `randt mission boot`: before the stages start.

use super::{now_ns, recover};
use crate::exit::Outcome;
use crate::mission::{CONFIGURATION, Mission};
use crate::missions::Missions;
use crate::output::{print, write_whole};
use randt_config::SelectionArguments;
use randt_stage::{Realm, RealmArguments, wipe};
use std::fs;

/// In the run folder: whose state it is that stages left there.
const OWNER: &str = "mission";

/// Arguments of `randt mission boot`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    selection: SelectionArguments,
    #[command(flatten)]
    realm: RealmArguments,
}

/// Goes on with the last mission where it was interrupted a short while ago, else begins a new one.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let realm = arguments.realm.realm()?;
    if wipe(&realm, false)?.is_none() {
        return print("the stages run already: the mission is what it is\n")
            .map(|()| Outcome::Good);
    }
    let now_ns = now_ns();
    let (mission, how) = match missions.current() {
        Some(mut mission) if mission.goes_on(now_ns) => {
            recover::set_aside(&mission)?;
            mission.resume(now_ns)?;
            (mission, "goes on")
        }
        last => {
            if let Some(last) = last {
                recover::set_aside(&last)?;
            }
            (missions.begin(None, now_ns)?, "begins")
        }
    };
    disown(&realm, &mission)?;
    // A wrong configuration is told by each stage that it stops.
    if let Ok(loaded) = arguments.selection.load(None) {
        let path = mission.folder().join(CONFIGURATION);
        write_whole(&path, loaded.to_toml().as_bytes())?;
    }
    print(&format!("{}: {how}\n", mission.name()))?;
    Ok(Outcome::Good)
}

/// What stages of another mission left in memory would make this one go on where that was.
fn disown(realm: &Realm, mission: &Mission) -> anyhow::Result<()> {
    let path = realm.folder().join(OWNER);
    let owner = fs::read_to_string(&path).unwrap_or_default();
    if owner != mission.name() {
        wipe(realm, true)?;
        write_whole(&path, mission.name().as_bytes())?;
    }
    Ok(())
}
