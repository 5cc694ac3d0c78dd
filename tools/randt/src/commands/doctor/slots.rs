//! Slots of the bus's services that nobody living holds: when all are taken, no stage can start.

use super::finding::Finding;
use super::snapshot::{AGAIN, DomainSnapshot};
use crate::units::count;
use randt_stage::orphaned_slots;
use std::collections::BTreeMap;

/// Every slot is held by a living stage or tool.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "slots";
    if snapshot.living().next().is_none() {
        // The next stage that starts makes all services anew.
        return Vec::new();
    }
    let held = held_by_nobody(snapshot);
    let slots: usize = held.values().sum();
    vec![if slots == 0 {
        Finding::ok(ABOUT, "every slot of a service is held by somebody living")
    } else {
        let text = format!(
            "{} of {} ({}) held by nobody living",
            count(slots as u64, "slot", "slots"),
            count(held.len() as u64, "service", "services"),
            held.into_keys().collect::<Vec<_>>().join(", ")
        );
        let fix = format!("randt doctor --clean {}", snapshot.options());
        Finding::warn(ABOUT, text, fix)
    }]
}

/// Those that are nobody's now and a moment later.
fn held_by_nobody(snapshot: &DomainSnapshot) -> BTreeMap<String, usize> {
    let before = orphaned_slots(&snapshot.domain);
    if before.is_empty() {
        return before;
    }
    std::thread::sleep(AGAIN);
    let mut still = orphaned_slots(&snapshot.domain);
    still.retain(|service, _| before.contains_key(service));
    still
}
