//! `randt mission export`: a mission to take away.

use super::{recover, report};
use crate::exit::Outcome;
use crate::mission::{Mission, REPORT};
use crate::missions::Missions;
use crate::output::{print, warn};
use crate::progress;
use crate::units::bytes;
use anyhow::{Context, ensure};
use std::fs;
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

/// Copies it under a temporary name, mends the copy, writes its report, and renames it: whole or not at all.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mission = match &arguments.name {
        Some(name) => missions.get(name)?,
        None => missions.current()?.context("there is no mission yet")?,
    };
    let to = arguments.out.join(mission.name());
    ensure!(!to.exists(), "{}: exists already", to.display());
    let part = arguments.out.join(format!("{}.part", mission.name()));
    // Of an export that was ended.
    let _ = fs::remove_dir_all(&part);
    let size = match copy(mission.folder(), &part) {
        Err(error) => {
            // Best effort: the first error is what the user needs to see.
            let _ = fs::remove_dir_all(&part);
            return Err(error);
        }
        Ok(size) => size,
    };
    let mut copied = Mission::open(&part)?;
    copied.repair()?;
    recover::set_aside(&copied)?;
    recover::mend(&copied)?;
    let mut outcome = Outcome::Good;
    // One that was stopped has its report: nothing that was known then is there to make a better one.
    if !copied.has_report() {
        let state = copied.kept_state();
        match report::write(
            &copied,
            &mission.name(),
            state.as_deref(),
            &part.join(REPORT),
        ) {
            Ok(true) => outcome = Outcome::DataLost,
            Ok(false) => {}
            Err(error) => warn(&format!("{}: no report: {error:#}", mission.name())),
        }
        copied.drop_state()?;
    }
    fs::rename(&part, &to).with_context(|| to.display().to_string())?;
    print(&format!("{}: {}\n", to.display(), bytes(size)))?;
    Ok(outcome)
}

/// Copies a folder; gives its bytes.
fn copy(from: &Path, to: &Path) -> anyhow::Result<u64> {
    let files = files_below(from)?;
    let sizes = files.iter().filter_map(|file| fs::metadata(file).ok());
    let bar = progress::bar(Some(sizes.map(|found| found.len()).sum()), "bytes");
    let mut copied = 0;
    for file in files {
        let Ok(name) = file.strip_prefix(from) else {
            continue;
        };
        let target = to.join(name);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        let size = fs::copy(&file, &target)
            .with_context(|| format!("{}: cannot be copied", file.display()))?;
        copied += size;
        bar.inc(size);
    }
    bar.finish_and_clear();
    Ok(copied)
}

fn files_below(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(files_below(&path)?);
        } else if path.extension().is_none_or(|ending| ending != "lock") {
            files.push(path);
        }
    }
    Ok(files)
}
