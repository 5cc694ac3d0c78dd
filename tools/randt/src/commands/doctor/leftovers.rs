//! What dead stages left behind.

use super::finding::Finding;
use super::processes::{FileId, id};
use super::snapshot::DomainSnapshot;
use crate::units::{bytes, count};
use randt_stage::{Leftover, leftovers};
use std::collections::BTreeSet;
use std::fs;
use std::time::Duration;

/// What a stage that starts or ends has made and not yet opened is looked at again after this
/// time.
const AGAIN: Duration = Duration::from_millis(200);
/// Nobody keeps this open; it stays until the domain is cleaned, and is 16 bytes long.
const SHARED_BY_ALL: &str = ".global_mgmt";
/// A living node keeps this open.
const NODE: &str = ".node_monitor";

/// No node and no segment is left of a stage that is dead.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "leftovers";
    let lives = snapshot.inside().next().is_some();
    let unseen = snapshot
        .inside()
        .filter(|process| process.presence.is_none());
    if let unseen @ 1.. = unseen.count() {
        let text = format!(
            "not looked for: what {} hold open is not shown to this user; the next stage that starts clears away what is left",
            count(unseen as u64, "process", "processes")
        );
        return vec![Finding::ok(ABOUT, text)];
    }
    let left = if lives {
        unheld(snapshot)
    } else {
        everything(snapshot)
    };
    if left.is_empty() {
        return vec![Finding::ok(ABOUT, "nothing is left of dead stages")];
    }
    let sum = bytes(left.iter().map(|file| file.bytes).sum());
    let left = count(left.len() as u64, "file", "files");
    vec![if lives {
        let text = format!(
            "{left} ({sum}) of dead stages: nodes and segments that no living process has open"
        );
        Finding::warn(
            ABOUT,
            text,
            "nothing: the next stage that starts clears them away",
        )
    } else {
        let text = format!("{left} ({sum}) of dead stages");
        Finding::warn(
            ABOUT,
            text,
            format!("randt doctor --clean {}", snapshot.options()),
        )
    }]
}

fn everything(snapshot: &DomainSnapshot) -> Vec<Leftover> {
    let mut left = leftovers(&snapshot.domain);
    left.retain(|file| !file.path.to_string_lossy().ends_with(SHARED_BY_ALL));
    left
}

/// Segments and nodes that no living process has open, now and a moment later.
fn unheld(snapshot: &DomainSnapshot) -> Vec<Leftover> {
    let before = unheld_now(snapshot);
    if before.is_empty() {
        return before;
    }
    std::thread::sleep(AGAIN);
    let mut still = unheld_now(&DomainSnapshot::take(snapshot.domain.clone()));
    still.retain(|file| before.contains(file));
    still
}

fn unheld_now(snapshot: &DomainSnapshot) -> Vec<Leftover> {
    let held: BTreeSet<FileId> = snapshot
        .inside()
        .flat_map(|process| process.open.clone())
        .collect();
    let mut left = everything(snapshot);
    left.retain(|file| {
        let matters = file.path.starts_with("/dev/shm")
            && !file.path.starts_with(snapshot.domain.root())
            || file.path.to_string_lossy().ends_with(NODE);
        matters && fs::metadata(&file.path).is_ok_and(|found| !held.contains(&id(&found)))
    });
    left
}
