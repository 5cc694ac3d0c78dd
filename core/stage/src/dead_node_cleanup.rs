//! Clears away what dead stages leave behind while others live.
//!
//! A process may be killed at any moment: while it makes a node, a service or a port, and while it
//! clears another one away. So nothing is concluded from what a dead process has or has not done.
//! The holder of a slot is read from the services' segments, and the nodes that live from the
//! locks of their files. A node that is dead never lives again, so the two need not be read at one
//! instant: a slot is orphaned when its node is dead after the slot was read. iceoryx2 then takes
//! the node out of the service, and a node's files are removed when no service has it any more. A
//! process that is killed during the clean-up leaves what the next one finds; iceoryx2's own
//! clean-up, which forgets a node with its files, is switched off (`ports::configuration`).
//!
//! Processes start one at a time, under one lock: its holder knows that what is half made was left
//! by a dead process.

mod leftovers;
mod node_count;
mod node_files;
mod service_slots;

pub(crate) use leftovers::remove_all;
pub use leftovers::{Leftover, leftovers, wipe};
pub(crate) use node_files::NodeFiles;
pub(crate) use service_slots::{is_own_file, owner_of, services};

use crate::domain::{SHARED_MEMORY, close_to_others};
use crate::{Domain, Error, ports};
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::ipc;
use iceoryx2::service::{internal::ServiceInternal, service_hash::ServiceHash};
use service_slots::{Service, ServiceSlot, segments};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A process that dies meanwhile is met in the next round, and kills are seldom faster than
/// rounds.
const ROUNDS: usize = 5;
/// Permission to write is taken from a service's definition when it is whole.
const HALF_MADE: u32 = 0o200;
/// Permission to read is given to a piece of shared memory when it is whole.
const WHOLE: u32 = 0o400;
/// Connections are made whenever two ports meet, by stages that run, in microseconds: one that is
/// half made for this time was left by a dead one. Everything else is made under the lock of those
/// who start.
const CONNECTION: &str = "connection";
const MADE_WITHIN: Duration = Duration::from_secs(1);
/// A service that no process can join and whose last stage is just removing it is gone after this
/// time.
const REMOVED_WITHIN: Duration = Duration::from_millis(100);

/// What was cleared away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CleanUp {
    /// Slots of services that no living node held.
    pub slots: usize,
    /// Dead nodes that had files.
    pub nodes: usize,
    /// Services that no process could join any more.
    pub services: usize,
}

/// Clears away what dead stages have left, while others live. Waits for a process that is just
/// starting. As [`orphaned_slots`], not for a process that is in the domain itself.
pub fn clean_up(domain: &Domain) -> Result<CleanUp, Error> {
    let _start = domain.start()?;
    clean_up_before_start(domain)
}

/// The same under the lock of those who start, before this process has a node of its own.
pub(crate) fn clean_up_before_start(domain: &Domain) -> Result<CleanUp, Error> {
    remove_half_made(domain);
    remove_half_made_memory(domain);
    close_to_others(domain)?;
    node_count::prepare(domain)?;
    let mut done = CleanUp::default();
    let files = NodeFiles::in_domain(domain, None);
    for _ in 0..ROUNDS {
        done.slots += free_slots(domain, None)?;
        // Deaths first: a node that is dead takes no slot after that.
        let ids = files.ids().into_iter();
        let dead: Vec<u128> = ids.filter(|id| !files.lives(*id)).collect();
        let holders = holders(domain);
        let is_held = |id: &u128| holders.contains(&owner_of(*id));
        let (held, free): (Vec<u128>, Vec<u128>) = dead.into_iter().partition(is_held);
        free.iter().for_each(|id| files.remove(*id));
        done.nodes += free.len();
        if held.is_empty() {
            break;
        }
    }
    done.services = remove_unusable_services(domain);
    remove_orphans(domain, &files);
    Ok(done)
}

/// Slots that no living node holds, by the names of their services. Not for a process that is in
/// the domain itself: checking the lock of its own node gives it up.
pub fn orphaned_slots(domain: &Domain) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for (service, slots) in dead_slots(domain, &NodeFiles::in_domain(domain, None)) {
        *counts.entry(service.name).or_default() += slots.len();
    }
    counts
}

/// Frees all slots that no living node holds; returns how many. `own`: the node of this process,
/// if it has one.
pub(crate) fn free_slots(domain: &Domain, own: Option<u128>) -> Result<usize, Error> {
    let files = NodeFiles::in_domain(domain, own);
    let configuration = ports::configuration(domain)?;
    let mut freed = 0;
    for (service, slots) in dead_slots(domain, &files) {
        let Ok(hash) = ServiceHash::try_from(service.hash.as_str()) else {
            continue;
        };
        for node in nodes_of(&slots, &files) {
            for port in slots.iter().filter_map(|slot| slot.port) {
                // If this fails the slot stays taken, and is met by the next process.
                let _ = files.restore_port(node, port);
                remove_half_made_connections(domain, port);
            }
            let Some(id) = node_id(node) else {
                continue;
            };
            // What it could not free is found below, in the slots.
            let _ = ipc::Service::__internal_remove_node_from_service(&id, &hash, &configuration);
        }
        let still = service.slots().unwrap_or_default();
        freed += slots.iter().filter(|slot| !still.contains(slot)).count();
    }
    Ok(freed)
}

/// Services with their slots that no living node holds.
fn dead_slots(domain: &Domain, files: &NodeFiles) -> Vec<(Service, Vec<ServiceSlot>)> {
    let mut lives = BTreeMap::new();
    let mut found = Vec::new();
    for service in services(domain) {
        let Some(mut slots) = service.slots() else {
            continue;
        };
        // Checked after the slot was read.
        slots.retain(|slot| {
            let owner = slot.owner;
            !*lives
                .entry(owner)
                .or_insert_with(|| files.owner_lives(owner))
        });
        if !slots.is_empty() {
            found.push((service, slots));
        }
    }
    found
}

/// The owners of all slots of all services.
fn holders(domain: &Domain) -> BTreeSet<u64> {
    let services = services(domain).into_iter();
    let open = services.filter_map(|service| service.slots());
    open.flatten().map(|slot| slot.owner).collect()
}

/// The nodes that hold slots. One that was killed before it had written its id has files; if
/// those are gone as well, any id of that owner serves, because an entry that is not written is
/// compared by its owner.
fn nodes_of(slots: &[ServiceSlot], files: &NodeFiles) -> BTreeSet<u128> {
    let mut nodes: BTreeSet<u128> = slots.iter().filter_map(|slot| slot.node).collect();
    let named: BTreeSet<u64> = nodes.iter().map(|node| owner_of(*node)).collect();
    let ids = files.ids();
    for owner in slots.iter().map(|slot| slot.owner) {
        if !named.contains(&owner) {
            let id = ids.iter().copied().find(|id| owner_of(*id) == owner);
            nodes.insert(id.unwrap_or(u128::from(owner) << 64));
        }
    }
    nodes
}

/// The id as iceoryx2 has it. It has no constructor from a number, but it deserializes them.
fn node_id(node: u128) -> Option<UniqueNodeId> {
    let id = serde_json::json!({
        "payload_value": node as u64,
        "unique_value": owner_of(node),
    });
    serde_json::from_value(id).ok()
}

/// Services that no process can join: closed and not removed, cut short, or without a segment. A
/// process that still holds one notices it (`memory::watch`).
fn remove_unusable_services(domain: &Domain) -> usize {
    let unusable = || -> Vec<Service> {
        let all = services(domain).into_iter();
        all.filter(|service| service.slots().is_none()).collect()
    };
    let before = unusable();
    if before.is_empty() {
        return 0;
    }
    std::thread::sleep(REMOVED_WITHIN);
    let still: Vec<Service> = unusable();
    let gone = still.iter().filter(|service| before.contains(service));
    gone.map(|service| {
        // Best effort, as with nodes.
        let _ = fs::remove_file(&service.definition);
        if let Some(segment) = &service.segment {
            let _ = fs::remove_file(segment);
        }
    })
    .count()
}

/// Memory and sockets of ports that no node has any more, and segments of services that no
/// definition names. Memory is named by its port, a connection by both of its ports; a port is
/// listed with its node before it makes any.
fn remove_orphans(domain: &Domain, files: &NodeFiles) {
    // What is found is searched for among owners that are read later: none is made before its
    // owner.
    let segments = segments(domain);
    let memory = files_of(domain, Path::new(SHARED_MEMORY));
    let found: Vec<(PathBuf, Metadata)> = memory.chain(files_of(domain, &domain.root())).collect();
    let services = services(domain).into_iter();
    let defined: BTreeSet<PathBuf> = services.filter_map(|service| service.segment).collect();
    let ports = files.ports();
    let segments = segments.into_values();
    let orphan_segments = segments.filter(|path| !defined.contains(path));
    let orphans = found.into_iter().filter_map(|(path, _)| {
        let (named, kind) = ports_of(domain, &path)?;
        let is_port = matches!(kind, "data" | "event_mgmt" | "event" | CONNECTION);
        let is_orphan = is_port && named.iter().any(|port| !ports.contains(port));
        is_orphan.then_some(path)
    });
    for path in orphans.chain(orphan_segments) {
        // Best effort, as with nodes.
        let _ = fs::remove_file(path);
    }
}

/// Connections of a dead port that are not whole: iceoryx2 cannot open them, and leaves the port's
/// slot taken.
fn remove_half_made_connections(domain: &Domain, port: u128) {
    remove_files(domain, Path::new(SHARED_MEMORY), |path, found| {
        let is_of_port = ports_of(domain, path)
            .is_some_and(|(ports, kind)| kind == CONNECTION && ports.contains(&port));
        !is_whole(found) && is_of_port
    });
}

/// Services whose maker died while it made them; no process can join them.
fn remove_half_made(domain: &Domain) {
    let folder = domain.root().join("services");
    remove_files(domain, &folder, |_, found| found.mode() & HALF_MADE != 0);
}

/// Shared memory whose maker died while it made it, or that was emptied: iceoryx2 cannot open it,
/// or waits for ever.
fn remove_half_made_memory(domain: &Domain) {
    remove_files(domain, Path::new(SHARED_MEMORY), |path, found| {
        let kind = path.extension().unwrap_or_default();
        let age = found.modified().ok().and_then(|made| made.elapsed().ok());
        let may_be_in_the_making = kind == CONNECTION && age.is_none_or(|age| age < MADE_WITHIN);
        !is_whole(found) && !may_be_in_the_making
    });
}

/// Whether a piece of shared memory was made to its end, and not emptied.
fn is_whole(memory: &Metadata) -> bool {
    memory.mode() & WHOLE != 0 && memory.len() > 0
}

fn remove_files(domain: &Domain, folder: &Path, is_dead: impl Fn(&Path, &Metadata) -> bool) {
    for (path, _) in files_of(domain, folder).filter(|(path, found)| is_dead(path, found)) {
        // Best effort, as with nodes.
        let _ = fs::remove_file(path);
    }
}

/// The domain's files in a folder: this user's, because any user can make one in /dev/shm.
fn files_of(domain: &Domain, folder: &Path) -> impl Iterator<Item = (PathBuf, Metadata)> {
    domain.files_in(folder).filter_map(|path| {
        let found = fs::symlink_metadata(&path).ok()?;
        let is_memory = is_own_file(&found) || found.file_type().is_socket();
        is_memory.then_some((path, found))
    })
}

/// The ports that a file is named by, one or two, and its kind.
fn ports_of<'a>(domain: &Domain, path: &'a Path) -> Option<(Vec<u128>, &'a str)> {
    let (stem, kind) = domain.name_parts(path)?;
    let count = if kind == CONNECTION { 2 } else { 1 };
    let ports = stem.rsplit('_').take(count).map(str::parse);
    Some((ports.collect::<Result<_, _>>().ok()?, kind))
}
