//! `randt mission export`: a mission to take away.

use super::copy::{Copied, copy};
use super::{recover, report};
use crate::exit::Outcome;
use crate::identity::Identity;
use crate::mission::{Mission, REPORT};
use crate::missions::Missions;
use crate::output::{print, warn};
use crate::units::bytes;
use anyhow::{Context, ensure};
use rustix::fs::{Mode, OFlags};
use std::fs;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

/// Arguments of `randt mission export`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Its name; if not given, the current or last one
    name: Option<String>,
    /// Folder in which the mission's own is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Copies it under a temporary name, repairs the copy, writes its report, and renames it: whole or
/// not at all.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mission = match &arguments.name {
        Some(name) => missions.get(name)?,
        None => missions.current()?.context("there is no mission yet")?,
    };
    let reader = Identity::in_force();
    let writer = Identity::of_way_to(&arguments.out)?;
    writer.run(|| export(&mission, reader, &arguments.out))
}

fn export(mission: &Mission, reader: Identity, out: &Path) -> anyhow::Result<Outcome> {
    let to = out.join(mission.name());
    ensure!(
        fs::symlink_metadata(&to).is_err(),
        "{}: exists already",
        to.display()
    );
    let part = out.join(format!("{}.part", mission.name()));
    // Of an export that was ended.
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    fs::create_dir(&part).with_context(|| part.display().to_string())?;
    match fill(mission, reader, &part) {
        Err(error) => {
            // Best effort: the first error is what the user needs to see.
            let _ = fs::remove_dir_all(&part);
            Err(error)
        }
        Ok((copied, outcome)) => {
            fs::rename(&part, &to).with_context(|| to.display().to_string())?;
            print(&format!("{}: {}\n", to.display(), bytes(copied.bytes)))?;
            Ok(outcome)
        }
    }
}

/// Copies a mission into a folder that was just made.
fn fill(mission: &Mission, reader: Identity, part: &Path) -> anyhow::Result<(Copied, Outcome)> {
    let context = || part.display().to_string();
    // By its descriptor: nothing is written to what may stand in its place later.
    let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder = rustix::fs::open(part, flags, Mode::empty()).with_context(context)?;
    let found = rustix::fs::fstat(&folder).with_context(context)?;
    ensure!(
        found.st_uid == rustix::process::geteuid().as_raw(),
        "{}: somebody else has made it",
        part.display()
    );
    let part = PathBuf::from(format!("/proc/self/fd/{}", folder.as_raw_fd()));
    let copied = copy(reader, mission.folder(), &part)?;
    let mut lost = copied.left_out > 0;
    let mut copy = Mission::open(&part)?;
    copy.repair()?;
    recover::mark_cut_logs(&copy)?;
    recover::repair_logs(&copy)?;
    // One that was stopped has its report: nothing that was known then is there to make a better
    // one.
    if !copy.has_report() {
        let state = copy.kept_state();
        match report::write(&copy, &mission.name(), state.as_deref(), &part.join(REPORT)) {
            Ok(report_lost) => lost |= report_lost,
            Err(error) => warn(&format!("{}: no report: {error:#}", mission.name())),
        }
        copy.drop_state()?;
    }
    Ok((copied, Outcome::finished(lost)))
}
