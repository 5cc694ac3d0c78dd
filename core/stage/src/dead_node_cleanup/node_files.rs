//! The files of the bus's nodes: which nodes live, and which ports a node has.

use super::owner_of;
use crate::Domain;
use rustix::process::{Flock, FlockType, fcntl_getlk};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Locked as long as the node lives.
const MONITOR: &str = ".node_monitor";
/// Files of a node beside its folder.
const BESIDE: [&str; 3] = [MONITOR, ".node_monitor_owner_lock", ".node_monitor_context"];
/// A file of this kind in the node's folder says that the port of this number may have memory and
/// slots.
const PORT_TAG: &str = ".port_tag";

/// The folder with the files of all nodes of a domain.
#[derive(Debug)]
pub(crate) struct NodeFiles {
    folder: PathBuf,
    prefix: String,
    /// The node of this process. Its files are not opened: a process that closes a file gives up
    /// all its locks on it.
    own: Option<u128>,
}

impl NodeFiles {
    /// Those in a domain. `own`: the node of this process, which lives.
    pub(crate) fn in_domain(domain: &Domain, own: Option<u128>) -> Self {
        Self {
            folder: domain.root().join("nodes"),
            prefix: domain.segment_prefix(),
            own,
        }
    }

    /// The file without which other processes take the node for dead, if it is missing.
    pub(crate) fn missing(&self, node: u128) -> Option<PathBuf> {
        let monitor = self.beside(node, MONITOR);
        (!monitor.exists()).then_some(monitor)
    }

    /// All nodes that have files.
    pub(crate) fn ids(&self) -> BTreeSet<u128> {
        let names = names(&self.folder).filter_map(|name| {
            let name = name.strip_prefix(&self.prefix).unwrap_or(&name);
            let end = name.find(|c: char| !c.is_ascii_digit());
            name.get(..end.unwrap_or(name.len()))?.parse().ok()
        });
        names.collect()
    }

    /// Whether a process holds the node. One that is dead never lives again.
    pub(crate) fn lives(&self, node: u128) -> bool {
        self.own == Some(node) || is_locked(&self.beside(node, MONITOR))
    }

    /// Whether a node with this owner number lives.
    pub(crate) fn owner_lives(&self, owner: u64) -> bool {
        let mut ids = self.ids().into_iter();
        ids.any(|node| owner_of(node) == owner && self.lives(node))
    }

    /// The ports that the nodes have or had.
    pub(crate) fn ports(&self) -> BTreeSet<u128> {
        let folders = names(&self.folder).map(|name| self.folder.join(name));
        let tags = folders.flat_map(|folder| names(&folder));
        tags.filter_map(|tag| {
            let number = tag.strip_prefix(&self.prefix)?.strip_suffix(PORT_TAG)?;
            number.parse().ok()
        })
        .collect()
    }

    /// Restores the tag of a port of the node: without that iceoryx2 leaves its slot taken.
    pub(crate) fn restore_port(&self, node: u128, port: u128) -> std::io::Result<()> {
        let folder = self.folder.join(node.to_string());
        fs::create_dir_all(&folder)?;
        let tag = folder.join(format!("{}{port}{PORT_TAG}", self.prefix));
        match File::create_new(tag) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
            _ => Ok(()),
        }
    }

    /// Removes all files of a node. Best effort: what cannot be removed now is met again by the
    /// next stage that starts.
    pub(crate) fn remove(&self, node: u128) {
        let _ = fs::remove_dir_all(self.folder.join(node.to_string()));
        for kind in BESIDE {
            let _ = fs::remove_file(self.beside(node, kind));
        }
    }

    fn beside(&self, node: u128, kind: &str) -> PathBuf {
        self.folder.join(format!("{}{node}{kind}", self.prefix))
    }
}

fn names(folder: &Path) -> impl Iterator<Item = String> + use<> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok())
}

/// Whether another process has locked a file. A file that does not exist is not locked; one that
/// this process may not open counts as locked.
fn is_locked(path: &Path) -> bool {
    match File::options().write(true).open(path) {
        Ok(file) => {
            let whole = Flock::from(FlockType::WriteLock);
            fcntl_getlk(&file, &whole).map_or(true, |holder| holder.is_some())
        }
        Err(error) => error.kind() != ErrorKind::NotFound,
    }
}
