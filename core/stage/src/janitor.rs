//! Clears away what dead stages leave behind.
//!
//! iceoryx2 clears away nodes that died in steady state by itself. A process that is killed in the milliseconds in which
//! it starts leaves a node that nobody may touch, or a service that is half made and that everybody waits for. Such nodes
//! pile up and make every start slower; such a service keeps all its stages from starting. So processes start one at a
//! time, under one lock: whoever holds it knows that what is half made was left by a dead one.

use crate::{Error, Realm, bus, realm::SHARED_MEMORY};
use iceoryx2::prelude::{CallbackProgression, Node, NodeState, ipc};
use rustix::fs::{FlockOperation, fcntl_lock};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Permission to write is taken from a service's file when it is whole.
const HALF_MADE: u32 = 0o200;
/// Permission to read is given to a piece of shared memory when it is whole.
const WHOLE: u32 = 0o400;
/// Connections are made whenever two ports meet, by stages that run, in microseconds: one that is half made for so long
/// was left by a dead one. Everything else is made under the lock of those who start.
const CONNECTION: &str = "connection";
const MADE_WITHIN: Duration = Duration::from_secs(1);
/// Files of a node beside its folder; the first is locked while the node lives.
const NODE_FILES: [&str; 3] = [
    ".node_monitor",
    ".node_monitor_owner_lock",
    ".node_monitor_context",
];

/// A file that a dead stage left behind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// Where.
    pub path: PathBuf,
    /// Memory that it takes, bytes.
    pub bytes: u64,
}

/// Clears dead nodes and half-made services away. Call it under the lock of those who start, and before this process has
/// a node of its own: whoever closes a file gives up all locks that he has on it.
pub(crate) fn sweep(realm: &Realm) -> Result<(), Error> {
    remove_half_made(realm);
    remove_half_made_memory(realm);
    let configuration = bus::configuration(realm)?;
    // What iceoryx2 can clear away itself, ports and segments included.
    let listed = Node::<ipc::Service>::list(&configuration, |state| {
        if let NodeState::Dead(dead) = state {
            // One that fails is looked at below.
            let _ = dead.try_remove_stale_resources();
        }
        CallbackProgression::Continue
    });
    listed.map_err(|cause| Error::bus("the list of nodes", cause))?;
    for id in dead_nodes(realm) {
        remove_node(realm, &id);
    }
    remove_orphans(realm);
    Ok(())
}

/// Memory and sockets of ports that no node has any more. Each is named by its port, a connection by both of its ports;
/// a port is listed with its node before it makes any of them.
fn remove_orphans(realm: &Realm) {
    let prefix = realm.segment_prefix();
    let below = |path: &Path| fs::read_dir(path).into_iter().flatten().flatten();
    let ports: BTreeSet<String> = below(&nodes(realm))
        .flat_map(|node| below(&node.path()))
        .filter_map(|tag| {
            let name = tag.file_name().into_string().ok()?;
            Some(
                name.strip_prefix(&prefix)?
                    .strip_suffix(".port_tag")?
                    .to_owned(),
            )
        })
        .collect();
    for entry in below(Path::new(SHARED_MEMORY)).chain(below(&realm.root())) {
        let name = entry.file_name();
        let Some((stem, kind)) = name
            .to_str()
            .and_then(|name| name.strip_prefix(&prefix)?.split_once('.'))
        else {
            continue;
        };
        let named_by = match kind {
            "data" | "event_mgmt" | "event" => 1,
            "connection" => 2,
            _ => continue,
        };
        if stem
            .rsplit('_')
            .take(named_by)
            .any(|port| !ports.contains(port))
        {
            // Best effort, as with nodes.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Services whose maker died over them; clearing a node away waits for its services.
fn remove_half_made(realm: &Realm) {
    let services = realm.root().join("services");
    for entry in fs::read_dir(services).into_iter().flatten().flatten() {
        let mode = entry
            .metadata()
            .map_or(0, |found| found.permissions().mode());
        if mode & HALF_MADE != 0 {
            // Best effort, as with nodes.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Shared memory whose maker died over it: iceoryx2 cannot open it, and then leaves the place of the dead port taken for
/// ever.
fn remove_half_made_memory(realm: &Realm) {
    let prefix = realm.segment_prefix();
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    for entry in entries {
        if !entry.file_name().to_string_lossy().starts_with(&prefix) {
            continue;
        }
        let path = entry.path();
        let Ok(found) = entry.metadata() else {
            continue;
        };
        let age = found.modified().ok().and_then(|made| made.elapsed().ok());
        let may_be_in_the_making = path.extension().is_some_and(|kind| kind == CONNECTION)
            && age.is_none_or(|age| age < MADE_WITHIN);
        if found.permissions().mode() & WHOLE == 0 && !may_be_in_the_making {
            // Best effort, as with nodes.
            let _ = fs::remove_file(path);
        }
    }
}

/// Nodes that nobody holds.
fn dead_nodes(realm: &Realm) -> BTreeSet<String> {
    let nodes = nodes(realm);
    let Ok(found) = fs::read_dir(&nodes) else {
        return BTreeSet::new();
    };
    let names = found.flatten().filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        let name = name.strip_prefix(&realm.segment_prefix()).unwrap_or(&name);
        let id: String = name.chars().take_while(char::is_ascii_digit).collect();
        (!id.is_empty()).then_some(id)
    });
    names
        .collect::<BTreeSet<_>>()
        .into_iter()
        .filter(|id| !is_held(&node_file(realm, id, NODE_FILES[0])))
        .collect()
}

/// Whether a process holds the lock of a file; nobody holds one that is not there.
fn is_held(path: &Path) -> bool {
    match File::options().write(true).open(path) {
        Ok(file) => fcntl_lock(&file, FlockOperation::NonBlockingLockExclusive).is_err(),
        Err(error) => error.kind() != std::io::ErrorKind::NotFound,
    }
}

fn remove_node(realm: &Realm, id: &str) {
    // Best effort: what cannot be removed now is met again by the next stage that starts.
    let _ = fs::remove_dir_all(nodes(realm).join(id));
    for suffix in NODE_FILES {
        let _ = fs::remove_file(node_file(realm, id, suffix));
    }
}

fn nodes(realm: &Realm) -> PathBuf {
    realm.root().join("nodes")
}

fn node_file(realm: &Realm, id: &str, suffix: &str) -> PathBuf {
    nodes(realm).join(format!("{}{id}{suffix}", realm.segment_prefix()))
}

/// Everything that iceoryx2 has of a realm: shared memory and files. While no stage lives, all of it is left over.
pub fn leftovers(realm: &Realm) -> Vec<Leftover> {
    let mut found = Vec::new();
    let prefix = realm.segment_prefix();
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    for entry in entries {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            add(entry.path(), &mut found);
        }
    }
    add_below(&realm.root(), &mut found);
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

fn add(path: PathBuf, found: &mut Vec<Leftover>) {
    // Blocks, not length: segments are full of holes.
    let bytes = fs::metadata(&path).map_or(0, |metadata| metadata.blocks() * 512);
    found.push(Leftover { path, bytes });
}

fn add_below(folder: &Path, found: &mut Vec<Leftover>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            add_below(&path, found);
        } else {
            add(path, found);
        }
    }
}

/// Takes away all that dead stages left, and with `state` also what would let new ones go on where they were. Gives
/// what was removed, or `None` where a stage or tool lives in the realm.
pub fn wipe(realm: &Realm, state: bool) -> Result<Option<Vec<Leftover>>, Error> {
    realm.make()?;
    let _door = realm.lock("door", true)?;
    let Some(_alone) = realm.try_alone()? else {
        return Ok(None);
    };
    let mut removed = leftovers(realm);
    if state {
        add_below(&realm.state(), &mut removed);
        let path = realm.state();
        fs::remove_dir_all(&path).map_err(Error::file(path, "cannot be removed"))?;
        let stages = realm.folder().join("stages");
        // There is none where no stage ever ran.
        let _ = fs::remove_dir_all(stages);
    }
    remove_all(realm)?;
    Ok(Some(removed))
}

/// Removes every file of iceoryx2. Only for whoever is alone.
pub(crate) fn remove_all(realm: &Realm) -> Result<(), Error> {
    for leftover in leftovers(realm) {
        let path = leftover.path;
        fs::remove_file(&path).map_err(Error::file(path, "cannot be removed"))?;
    }
    let root = realm.root();
    if root.is_dir() {
        fs::remove_dir_all(&root).map_err(Error::file(&root, "cannot be removed"))?;
    }
    fs::create_dir_all(&root).map_err(Error::file(&root, "cannot be made"))
}
