//! Whose the domain is, and what others may do in it. All stages must be one user's: shared memory
//! is.

use super::finding::Finding;
use super::snapshot::DomainSnapshot;
use randt_stage::{Domain, leftovers};
use rustix::fs::Access;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// The domain, its shared memory, its stages and this process are one user's.
pub fn check(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "user";
    let folder = snapshot.domain.folder();
    let (user, options) = (snapshot.user, snapshot.options());
    let Some(owner) = snapshot.owner else {
        let text = format!("{}: not there, no stage ever ran here", folder.display());
        return vec![Finding::ok(ABOUT, text)];
    };
    let mut found = Vec::new();
    if owner != user {
        let text = format!(
            "{} belongs to user {owner}, this process is user {user}: all stages and tools must run as one",
            folder.display()
        );
        let fix = format!("sudo -u '#{owner}' randt doctor {options}");
        found.push(Finding::bad(ABOUT, text, fix));
    }
    for process in snapshot.inside().filter(|process| process.user != owner) {
        let (theirs, pid) = (process.user, process.pid);
        let text = format!("{process} runs as user {theirs}, the domain belongs to user {owner}");
        let fix = format!("kill {pid}, and start it with sudo -u '#{owner}'");
        found.push(Finding::bad(ABOUT, text, fix));
    }
    let foreign = leftovers(&snapshot.domain).into_iter().filter_map(|file| {
        let theirs = fs::metadata(&file.path).ok()?.uid();
        (theirs != owner).then_some((theirs, file.path))
    });
    let foreign: Vec<_> = foreign.collect();
    if let Some((theirs, first)) = foreign.first() {
        let (count, first) = (foreign.len(), first.display());
        let text = format!(
            "{count} files of user {theirs} in the domain of user {owner}, such as {first}"
        );
        let prefix = snapshot.domain.segment_prefix();
        let fix = format!("end that user's stages, then sudo rm /dev/shm/{prefix}*");
        found.push(Finding::bad(ABOUT, text, fix));
    }
    if found.is_empty() {
        let text = format!("the domain, its stages and this process are user {user}");
        found.push(Finding::ok(ABOUT, text));
    }
    found
}

/// A domain's folder in which everybody may write.
pub fn open_to_all(domain: &Domain) -> Option<Finding> {
    let folder = domain.folder();
    let found = fs::symlink_metadata(&folder).ok()?;
    let is_open = found.is_dir() && found.mode() & 0o002 != 0;
    is_open.then(|| written_by_others(&folder, found.mode() & 0o777))
}

fn written_by_others(folder: &Path, mode: u32) -> Finding {
    let shown = folder.display();
    Finding::bad(
        "rights",
        format!("{shown} has mode {mode:03o}: others may write in it"),
        format!("chmod 700 {shown}"),
    )
}

/// The folder is its owner's alone, and can be written.
pub fn check_rights(snapshot: &DomainSnapshot) -> Vec<Finding> {
    const ABOUT: &str = "rights";
    let folder = snapshot.domain.folder();
    let shown = folder.display();
    let Ok(metadata) = fs::metadata(&folder) else {
        return Vec::new();
    };
    let mode = metadata.mode() & 0o777;
    let fix = format!("chmod 700 {shown}");
    if mode & 0o022 != 0 {
        return vec![written_by_others(&folder, mode)];
    }
    if mode & 0o700 != 0o700 {
        let text = format!("{shown} has mode {mode:03o}: its owner cannot use it");
        return vec![Finding::bad(ABOUT, text, fix)];
    }
    let writable = rustix::fs::access(&folder, Access::WRITE_OK | Access::EXEC_OK);
    if let Err(cause) = writable
        && snapshot.owner == Some(snapshot.user)
    {
        let text = format!("{shown} cannot be written: {cause}");
        let fix = format!(
            "mount -o remount,rw the file system of {shown}, or give all stages another --run"
        );
        return vec![Finding::bad(ABOUT, text, fix)];
    }
    if mode != 0o700 {
        let text = format!("{shown} has mode {mode:03o}: others may look into it");
        return vec![Finding::warn(ABOUT, text, fix)];
    }
    vec![Finding::ok(ABOUT, format!("{shown} has mode 700"))]
}
