//! Whether the memory that stages share is still there: one that goes on in removed memory reaches
//! nobody.

use super::finding::Finding;
use super::snapshot::{DomainSnapshot, program};
use randt_stage::memory_gone;

/// No file that a living stage shares with others was removed or cut.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "shared";
    // A stage notices it and ends by itself within two seconds; what is older is for people.
    let gone = snapshot.lasting(gone);
    let found = gone.iter().map(|(name, pid, files, first)| {
        let text = format!(
            "shared memory of living stages is gone: {} (process {pid}) uses {files} files that were removed or cut, {first} among them",
            program(name)
        );
        let fix = format!(
            "kill {pid} and start it again, if its supervisor does not; if this comes at every logout: RemoveIPC=no in /etc/systemd/logind.conf"
        );
        Finding::bad(ABOUT, text, fix)
    });
    found.collect()
}

/// Living stages whose memory is gone: name, process, how many files, the first of them.
fn gone(snapshot: &DomainSnapshot) -> Vec<(String, u64, usize, String)> {
    let stages = snapshot.living().filter_map(|entry| {
        let gone = memory_gone(&snapshot.domain, entry);
        let first = gone.first()?.display().to_string();
        Some((entry.name.clone(), entry.pid, gone.len(), first))
    });
    stages.collect()
}
