//! `randt doctor --clean`: takes away what dead stages left, when no stage lives.

use super::scene::Scene;
use crate::exit::Outcome;
use crate::output::print;
use crate::units::{bytes, count};
use anyhow::bail;
use randt_stage::{Registry, leftovers, wipe};

/// Cleans, or says who lives.
pub fn run(scene: &Scene, state: bool) -> anyhow::Result<Outcome> {
    let realm = &scene.realm;
    let here = format!("realm {} in {}", realm.prefix(), realm.run().display());
    let living = living(scene);
    if !living.is_empty() {
        bail!(
            "{here}: nothing was removed, for {} in it: stop that first",
            living.join(", ")
        );
    }
    if scene.owner.is_none() && leftovers(realm).is_empty() {
        print(&format!("{here}: not there, nothing to remove\n"))?;
        return Ok(Outcome::Good);
    }
    let Some(removed) = wipe(realm, state)? else {
        bail!(
            "{here}: nothing was removed, for a process is in it that came just now or cannot be seen"
        );
    };
    if !state {
        // Whoever cleans knows that they are dead.
        Registry::settle(realm)?;
    }
    let sum = bytes(removed.iter().map(|file| file.bytes).sum());
    let removed = count(removed.len() as u64, "file", "files");
    let kept = if state {
        ""
    } else {
        "; checkpoints and keyframes are kept (--state removes them too)"
    };
    print(&format!("{here}: removed {removed}, {sum}{kept}\n"))?;
    Ok(Outcome::Good)
}

/// Everybody in this realm, and everybody whose shared memory has the same names.
fn living(scene: &Scene) -> Vec<String> {
    let prefix = |folder: &std::path::Path| {
        folder
            .file_name()
            .is_some_and(|name| name == scene.realm.prefix())
    };
    let processes = scene.processes.iter();
    let mut living: Vec<String> = processes
        .filter(|process| scene.is_in(process) || prefix(&process.folder))
        .map(|process| format!("{process} is"))
        .collect();
    // What the register knows and this process may not look at.
    let unseen = scene.living().filter(|entry| {
        let seen = |process: &super::processes::Process| u64::from(process.pid) == entry.pid;
        !scene.processes.iter().any(seen)
    });
    living.extend(unseen.map(|entry| format!("randt-{} (process {}) is", entry.name, entry.pid)));
    living
}
