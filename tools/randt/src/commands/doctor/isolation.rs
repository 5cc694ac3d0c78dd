//! Stages that do not see each other although somebody meant them to.

use super::finding::Finding;
use super::processes::Process;
use super::snapshot::DomainSnapshot;
use randt_stage::Domain;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

const ABOUT: &str = "isolation";

/// All stages are in this domain and see the same files. `by_default`: the run folder was not
/// named.
pub fn check(snapshot: &DomainSnapshot, by_default: bool) -> Vec<Finding> {
    let shared_memory = fs::metadata("/dev/shm").ok().map(|found| found.dev());
    let mut found = Vec::new();
    let mut others: BTreeMap<&Path, Vec<String>> = BTreeMap::new();
    for process in &snapshot.processes {
        if snapshot.is_in(process) {
            found.extend(apart(process, shared_memory));
        } else if let Some(lost) = lost(snapshot, process) {
            found.push(lost);
        } else {
            let there = others.entry(&process.folder).or_default();
            there.push(process.to_string());
        }
    }
    for (folder, there) in others {
        let (folder, there, options) = (folder.display(), there.join(", "), snapshot.options());
        let text = format!("another domain is in {folder}: {there}");
        let fix = format!("nothing, if that is meant; else start them with {options}");
        found.push(Finding::warn(ABOUT, text, fix));
    }
    if by_default {
        found.extend(both_folders(snapshot));
    }
    if found.is_empty() {
        let text = match snapshot.inside().count() {
            0 => "no stage lives, here or elsewhere".to_owned(),
            1 => "one process, here".to_owned(),
            count => format!("{count} processes, all here"),
        };
        found.push(Finding::ok(ABOUT, text));
    }
    found
}

/// In the domain, but with other shared memory.
fn apart(process: &Process, shared_memory: Option<u64>) -> Option<Finding> {
    // Where one of them cannot be seen nothing is known.
    (process.shared_memory? != shared_memory?).then(|| {
        Finding::bad(
            ABOUT,
            format!("{process} has a /dev/shm of its own: it neither receives from the others nor reaches them"),
            "start it in the same container and mount namespace as the others (docker run --ipc=host)",
        )
    })
}

/// In a domain that only looks like this one.
fn lost(snapshot: &DomainSnapshot, process: &Process) -> Option<Finding> {
    let (ours, theirs) = (snapshot.domain.folder(), &process.folder);
    if theirs.file_name() != ours.file_name() {
        return None;
    }
    let shown = theirs.display();
    let (pid, options) = (process.pid, snapshot.options());
    let restart = format!("kill {pid}, and start it with {options}");
    Some(if process.removed {
        let text =
            format!("{process} is in {shown}, which was removed under it: nobody finds it there");
        Finding::bad(ABOUT, text, restart)
    } else if *theirs == ours {
        let text = format!("{process} sees another {shown}: it has a mount namespace of its own");
        let fix =
            "give all of them a --run that all see, or none a namespace (systemd: PrivateTmp=no)";
        Finding::bad(ABOUT, text, fix)
    } else {
        let text = format!(
            "{process} has the same prefix in another run folder, {shown}: the two do not see each other"
        );
        Finding::bad(ABOUT, text, restart)
    })
}

/// Without --run a stage takes /run/randt or the folder of its user's session, or where neither is
/// there yet the other folder.
fn both_folders(snapshot: &DomainSnapshot) -> Option<Finding> {
    let other = Domain::shared_run(snapshot.user).join(snapshot.domain.prefix());
    let both = snapshot.domain.folder() != other && Path::new(&other).is_dir();
    both.then(|| {
        let (other, run) = (other.display(), snapshot.domain.run().display());
        let text =
            format!("{other} is there too: stages that started before {run} was made were there");
        let fix = format!("rm -r {other}, when no stage is in it");
        Finding::warn(ABOUT, text, fix)
    })
}
