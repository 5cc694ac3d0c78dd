//! Whether somebody else may touch what stages share: memory, sockets, locks, checkpoints.

use super::finding::Finding;
use super::snapshot::DomainSnapshot;
use crate::units::count;
use randt_stage::exposed;

/// Bits by which its group and everybody may touch a file.
const OTHERS: u32 = 0o077;

/// Every file of the domain is its owner's and nobody else's to read or write.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "exposed";
    let Some(owner) = snapshot.owner else {
        return Vec::new();
    };
    let files = exposed(&snapshot.domain);
    let own = files.iter().filter(|file| file.owner == owner);
    let mut open = own.filter(|file| file.mode & OTHERS != 0);
    let mut found = Vec::new();
    if let Some(first) = open.next() {
        let text = format!(
            "{} that other users may read or write, such as {} (mode {:o})",
            count(1 + open.count() as u64, "file", "files"),
            first.path.display(),
            first.mode
        );
        let fix = format!("randt doctor --clean {}", snapshot.options());
        found.push(Finding::bad(ABOUT, text, fix));
    }
    // Files of another user's are reported beside that (owner).
    if found.is_empty() && files.iter().all(|file| file.owner == owner) {
        let text = "memory, sockets and files are for their owner alone";
        found.push(Finding::ok(ABOUT, text));
    }
    found
}
