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
pub(crate) use service_slots::{ServiceSlots, is_own_file, owner_of, services};

use crate::domain::{SHARED_MEMORY, close_to_others};
use crate::{Domain, Error, ports};
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::ipc;
use iceoryx2::service::{internal::ServiceInternal, service_hash::ServiceHash};
use service_slots::{Service, ServiceSlot, segments};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
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
        let dead: Vec<u128> = files
            .ids()
            .into_iter()
            .filter(|id| !files.lives(*id))
            .collect();
        let holders = holders(domain);
        let (held, free): (Vec<u128>, Vec<u128>) = dead
            .into_iter()
            .partition(|id| holders.contains(&owner_of(*id)));
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
        let still = match service.slots() {
            ServiceSlots::Open(still) => still,
            ServiceSlots::Closed | ServiceSlots::Unusable => Vec::new(),
        };
        freed += slots.iter().filter(|slot| !still.contains(slot)).count();
    }
    Ok(freed)
}

/// Services with their slots that no living node holds.
fn dead_slots(domain: &Domain, files: &NodeFiles) -> Vec<(Service, Vec<ServiceSlot>)> {
    let mut lives = BTreeMap::new();
    let mut found = Vec::new();
    for service in services(domain) {
        let ServiceSlots::Open(mut slots) = service.slots() else {
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
    let slots = services(domain).into_iter().map(|service| service.slots());
    let open = slots.filter_map(|slots| match slots {
        ServiceSlots::Open(slots) => Some(slots),
        ServiceSlots::Closed | ServiceSlots::Unusable => None,
    });
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
        all.filter(|service| !matches!(service.slots(), ServiceSlots::Open(_)))
            .collect()
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
    let segments = segments(&domain.segment_prefix());
    let memory = files_of(domain, Path::new(SHARED_MEMORY));
    let found: Vec<(PathBuf, Metadata)> = memory.chain(files_of(domain, &domain.root())).collect();
    let services = services(domain).into_iter();
    let defined: BTreeSet<PathBuf> = services.filter_map(|service| service.segment).collect();
    let ports = files.ports();
    let orphan_segments = segments
        .into_values()
        .filter(|path| !defined.contains(path));
    let orphans = found.into_iter().filter_map(|(path, _)| {
        let (named, kind) = ports_of(domain, &path)?;
        let is_port = matches!(kind.as_str(), "data" | "event_mgmt" | "event" | CONNECTION);
        (is_port && named.iter().any(|port| !ports.contains(port))).then_some(path)
    });
    for path in orphans.chain(orphan_segments) {
        // Best effort, as with nodes.
        let _ = fs::remove_file(path);
    }
}

/// Connections of a dead port that are not whole: iceoryx2 cannot open them, and leaves the port's
/// slot taken.
fn remove_half_made_connections(domain: &Domain, port: u128) {
    for (path, found) in files_of(domain, Path::new(SHARED_MEMORY)) {
        let is_half_made = found.len() == 0 || found.permissions().mode() & WHOLE == 0;
        let is_of_port = ports_of(domain, &path)
            .is_some_and(|(ports, kind)| kind == CONNECTION && ports.contains(&port));
        if is_half_made && is_of_port {
            // Best effort, as with nodes.
            let _ = fs::remove_file(path);
        }
    }
}

/// Services whose maker died while it made them; no process can join them.
fn remove_half_made(domain: &Domain) {
    for (path, found) in files_of(domain, &domain.root().join("services")) {
        if found.permissions().mode() & HALF_MADE != 0 {
            // Best effort, as with nodes.
            let _ = fs::remove_file(path);
        }
    }
}

/// Shared memory whose maker died while it made it, or that was emptied: iceoryx2 cannot open it,
/// or waits for ever.
fn remove_half_made_memory(domain: &Domain) {
    for (path, found) in files_of(domain, Path::new(SHARED_MEMORY)) {
        let kind = path.extension().unwrap_or_default();
        let age = found.modified().ok().and_then(|made| made.elapsed().ok());
        let may_be_in_the_making = kind == CONNECTION && age.is_none_or(|age| age < MADE_WITHIN);
        let is_whole = found.permissions().mode() & WHOLE != 0 && found.len() > 0;
        if !is_whole && !may_be_in_the_making {
            // Best effort, as with nodes.
            let _ = fs::remove_file(path);
        }
    }
}

/// The domain's files in a folder: this user's, because any user can make one in /dev/shm.
fn files_of(domain: &Domain, folder: &Path) -> impl Iterator<Item = (PathBuf, Metadata)> {
    let prefix = domain.segment_prefix();
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(move |entry| {
        let found = entry.metadata().ok()?;
        let is_ours = entry.file_name().to_string_lossy().starts_with(&prefix);
        let is_memory = is_own_file(&found) || found.file_type().is_socket();
        (is_ours && is_memory).then(|| (entry.path(), found))
    })
}

/// The ports that a file is named by, one or two, and its kind.
fn ports_of(domain: &Domain, path: &Path) -> Option<(Vec<u128>, String)> {
    let name = path.file_name()?.to_str()?;
    let (stem, kind) = name
        .strip_prefix(&domain.segment_prefix())?
        .split_once('.')?;
    let count = if kind == CONNECTION { 2 } else { 1 };
    let ports = stem.rsplit('_').take(count).map(str::parse);
    Some((ports.collect::<Result<_, _>>().ok()?, kind.to_owned()))
}
