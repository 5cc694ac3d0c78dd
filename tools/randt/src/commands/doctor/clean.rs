//! `randt doctor --clean`: takes away what dead stages left: everything when no stage lives, else
//! what nobody living holds.

use super::processes::Process;
use super::snapshot::{DomainSnapshot, program};
use crate::exit::Outcome;
use crate::output::print;
use crate::units::{bytes, count};
use anyhow::{bail, ensure};
use randt_stage::{Registry, clean_up, leftovers, orphaned_slots, wipe};

/// Cleans, or names who lives.
pub fn run(snapshot: &DomainSnapshot, state: bool) -> anyhow::Result<Outcome> {
    let domain = &snapshot.domain;
    let here = super::title(domain);
    let living = living(snapshot);
    if !living.is_empty() {
        ensure!(
            !state,
            "{here}: nothing was removed while somebody lives in it: stop {} first",
            living.join(", ")
        );
        return beside_the_living(snapshot, &here);
    }
    if snapshot.owner.is_none() && leftovers(domain).is_empty() {
        print(&format!("{here}: not there, nothing to remove\n"))?;
        return Ok(Outcome::Good);
    }
    let Some(removed) = wipe(domain, state)? else {
        bail!(
            "{here}: nothing was removed, for a process is in it that came just now or cannot be seen"
        );
    };
    if !state {
        // The user that cleans knows that they are dead.
        Registry::mark_dead_as_ended(domain)?;
    }
    let sum = bytes(removed.iter().map(|file| file.bytes).sum());
    let removed = count(removed.len() as u64, "file", "files");
    let kept = match state {
        true => "",
        false => "; checkpoints and keyframes are kept (--state removes them too)",
    };
    print(&format!("{here}: removed {removed}, {sum}{kept}\n"))?;
    Ok(Outcome::Good)
}

/// Takes away what nobody living holds.
fn beside_the_living(snapshot: &DomainSnapshot, here: &str) -> anyhow::Result<Outcome> {
    let done = clean_up(&snapshot.domain)?;
    let freed = count(done.slots as u64, "slot", "slots");
    let nodes = count(done.nodes as u64, "dead node", "dead nodes");
    let services = count(done.services as u64, "broken service", "broken services");
    print(&format!(
        "{here}: freed {freed}, removed {nodes} and {services}; the living were left alone\n"
    ))?;
    let left: usize = orphaned_slots(&snapshot.domain).values().sum();
    ensure!(
        left == 0,
        "{here}: {left} slots are still held by nobody: stop all stages, then clean once more"
    );
    Ok(Outcome::Good)
}

/// Everybody in this domain.
fn living(snapshot: &DomainSnapshot) -> Vec<String> {
    let mut living: Vec<String> = snapshot.inside().map(ToString::to_string).collect();
    // What the register knows and this process may not look at.
    let unseen = snapshot.living().filter(|entry| {
        let is = |process: &Process| u64::from(process.pid) == entry.pid;
        !snapshot.processes.iter().any(is)
    });
    living.extend(unseen.map(|entry| format!("{} (process {})", program(&entry.name), entry.pid)));
    living
}
