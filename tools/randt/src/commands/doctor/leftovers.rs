//! What dead stages left behind.

use super::finding::Finding;
use super::processes::{FileId, id};
use super::snapshot::DomainSnapshot;
use crate::units::{bytes, count};
use randt_stage::{Leftover, leftovers};
use std::collections::BTreeSet;
use std::fs;

/// Nobody keeps this open; it stays until the domain is cleaned, and is 16 bytes long.
const SHARED_BY_ALL: &str = ".global_mgmt";
/// A living node keeps this open.
const NODE: &str = ".node_monitor";

/// No node and no segment is left of a stage that is dead.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "leftovers";
    let lives = snapshot.inside().next().is_some();
    let unseen = snapshot.inside().filter(|it| it.presence.is_none());
    let unseen = unseen.count();
    if unseen > 0 {
        let text = format!(
            "not looked for: what {} hold open is not shown to this user; the next stage that starts clears away what is left",
            count(unseen as u64, "process", "processes")
        );
        return vec![Finding::ok(ABOUT, text)];
    }
    let left = match lives {
        true => snapshot.lasting(unheld),
        false => everything(snapshot),
    };
    if left.is_empty() {
        return vec![Finding::ok(ABOUT, "nothing is left of dead stages")];
    }
    let sum = bytes(left.iter().map(|file| file.bytes).sum());
    let left = count(left.len() as u64, "file", "files");
    let mut text = format!("{left} ({sum}) of dead stages");
    let mut fix = format!("randt doctor --clean {}", snapshot.options());
    if lives {
        text += ": nodes and segments that no living process has open";
        fix = "nothing: the next stage that starts clears them away".to_owned();
    }
    vec![Finding::warn(ABOUT, text, fix)]
}

fn everything(snapshot: &DomainSnapshot) -> Vec<Leftover> {
    let mut left = leftovers(&snapshot.domain);
    left.retain(|file| !file.path.to_string_lossy().ends_with(SHARED_BY_ALL));
    left
}

/// Segments and nodes that no living process has open.
fn unheld(snapshot: &DomainSnapshot) -> Vec<Leftover> {
    let held = snapshot.inside().flat_map(|process| &process.open);
    let held: BTreeSet<&FileId> = held.collect();
    let mut left = everything(snapshot);
    left.retain(|file| {
        let matters = file.path.starts_with("/dev/shm")
            && !file.path.starts_with(snapshot.domain.root())
            || file.path.to_string_lossy().ends_with(NODE);
        matters && fs::metadata(&file.path).is_ok_and(|found| !held.contains(&id(&found)))
    });
    left
}
