//! Whether the memory that a process shares with others is still the one that they share.
//!
//! Files in /dev/shm and in the run folder can be removed or cut by others: by logind at a user's
//! logout (RemoveIPC), or by hand. A process goes on in what it has mapped, alone: a process that
//! starts after that makes everything anew. So each process checks its own memory.

use crate::dead_node_cleanup::{NodeFiles, owner_of, services};
use crate::{Domain, Entry, Error, Presence, domain::SHARED_MEMORY, ports::Bus};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// What the kernel adds to the name of a file that was removed.
const DELETED: &str = " (deleted)";
/// Mappings are whole pages.
const PAGE: u64 = 4096;

/// Checks the memory of this process.
#[derive(Debug)]
pub(crate) struct MemoryWatch {
    domain: Domain,
    /// The node of this process.
    node: u128,
    /// Files that were gone before, and that this process has left for that reason
    /// (a player that opens its ports anew).
    left: BTreeSet<PathBuf>,
}

/// A file that a process has mapped.
#[derive(Debug)]
struct Mapping {
    path: PathBuf,
    bytes: u64,
    is_deleted: bool,
}

impl MemoryWatch {
    pub(crate) fn new(domain: &Domain, node: u128) -> Self {
        Self {
            domain: domain.clone(),
            node,
            left: BTreeSet::from_iter(gone_in(domain, std::process::id(), owner_of(node) as u32)),
        }
    }

    /// Files that this process has mapped and left.
    pub(crate) fn left_files(&self) -> u64 {
        self.left.len() as u64
    }

    /// Fails if memory of this process, the stage `name`, is gone: the bus does not release it
    /// then.
    pub(crate) fn check(&self, name: &str, presence: &Presence, bus: &Bus) -> Result<(), Error> {
        let gone = self.gone(presence);
        let files = gone.len();
        gone.into_iter().next().map_or(Ok(()), |path| {
            bus.memory_loss.set();
            Err(Error::MemoryGone {
                path,
                stage: name.to_owned(),
                files,
            })
        })
    }

    /// Files of this process that are gone: removed, cut short, or replaced.
    fn gone(&self, presence: &Presence) -> Vec<PathBuf> {
        let number = owner_of(self.node) as u32;
        let mut gone = gone_in(&self.domain, std::process::id(), number);
        gone.retain(|path| !self.left.contains(path));
        let files = NodeFiles::in_domain(&self.domain, Some(self.node));
        if let Some(missing) = files.missing(self.node) {
            gone.push(missing);
        }
        if !presence.is_in_place() {
            gone.push(self.domain.folder());
        }
        gone
    }
}

/// Files that a living stage of a domain has mapped and that are gone: removed, cut short, or
/// segments of services that no process can join any more. Empty for a process that may not be
/// inspected.
pub fn memory_gone(domain: &Domain, stage: &Entry) -> Vec<PathBuf> {
    let pid = u32::try_from(stage.pid).unwrap_or(0);
    let gone = gone_in(domain, pid, pid);
    if gone.len() as u64 > stage.left_files {
        gone
    } else {
        Vec::new()
    }
}

/// `number`: the process's number in its ports' numbers, which another PID namespace may see as
/// another `pid`.
fn gone_in(domain: &Domain, pid: u32, number: u32) -> Vec<PathBuf> {
    let open: Vec<PathBuf> = services(domain)
        .into_iter()
        .filter(|service| service.slots().is_some())
        .filter_map(|service| service.segment)
        .collect();
    let state = fs::canonicalize(domain.state()).unwrap_or_else(|_| domain.state());
    let mut gone = Vec::new();
    for mapping in mappings(pid) {
        let path = &mapping.path;
        let is_lost = match kind(domain, path, number) {
            Some(Kind::Service) => !open.contains(path) || mapping.is_gone(),
            Some(Kind::OwnPort) => mapping.is_gone(),
            None => path.starts_with(&state) && mapping.is_gone(),
        };
        if is_lost {
            gone.push(mapping.path);
        }
    }
    gone
}

/// What a mapped piece of shared memory is to its process.
enum Kind {
    /// The segment of a service that it has open.
    Service,
    /// Memory of one of its own ports. That of others' ports ends with them.
    OwnPort,
}

fn kind(domain: &Domain, path: &Path, number: u32) -> Option<Kind> {
    let in_memory = path.parent() == Some(Path::new(SHARED_MEMORY));
    let (stem, kind) = domain.name_parts(path).filter(|_| in_memory)?;
    match kind {
        "dynamic" => Some(Kind::Service),
        "data" | "event_mgmt" => {
            let port: u128 = stem.rsplit('_').next()?.parse().ok()?;
            // A port's number holds that of its process above the time when it was made.
            (owner_of(port) as u32 == number).then_some(Kind::OwnPort)
        }
        _ => None,
    }
}

impl Mapping {
    fn is_gone(&self) -> bool {
        let length = fs::metadata(&self.path).map_or(0, |found| found.len());
        self.is_deleted || length.next_multiple_of(PAGE) < self.bytes
    }
}

/// The files that a process has mapped, each once.
fn mappings(pid: u32) -> Vec<Mapping> {
    let text = fs::read_to_string(format!("/proc/{pid}/maps")).unwrap_or_default();
    let mut mappings: BTreeMap<&str, u64> = BTreeMap::new();
    for line in text.lines() {
        // Addresses, rights, offset, device, inode, and the name at the end.
        let mut words = line.splitn(6, ' ');
        let (Some(range), _, Some(offset)) = (words.next(), words.next(), words.next()) else {
            continue;
        };
        let name = words.nth(2).unwrap_or_default().trim_start();
        if !name.starts_with('/') {
            continue;
        }
        let address = |text: &str| u64::from_str_radix(text, 16).unwrap_or(0);
        let (begin, end) = range.split_once('-').unwrap_or_default();
        let end = address(offset) + address(end).saturating_sub(address(begin));
        let bytes = mappings.entry(name).or_default();
        *bytes = end.max(*bytes);
    }
    let mappings = mappings.into_iter();
    mappings
        .map(|(name, bytes)| {
            let path = name.strip_suffix(DELETED);
            Mapping {
                path: PathBuf::from(path.unwrap_or(name)),
                bytes,
                is_deleted: path.is_some(),
            }
        })
        .collect()
}
