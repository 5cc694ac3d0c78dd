//! Memory that is taken before it is written: when none is left, a store would end the process
//! without an error.
//!
//! iceoryx2 gives a segment its length and leaves it to the first store to take the pages. So each
//! publisher takes the pages of as many messages as can be alive at once, which are the first
//! ones, because the one that was given back last is used next; and a process that starts takes
//! all of the tables that it has made or joined.

use super::budget::free_bytes;
use crate::{Domain, Error, domain::SHARED_MEMORY, ports::qos};
use iceoryx2::service::header::publish_subscribe::Header;
use randt_messages::BusTopic;
use rustix::fs::{FallocateFlags, fallocate};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// iceoryx2's own table at the beginning of a segment is smaller, bytes.
const TABLE: usize = 512;
/// Alignment of messages.
const ALIGNMENT: usize = 8;
/// Larger messages than before seldom come alone: this fraction more is taken at once.
const GROWTH: usize = 4;
/// Kind of the segments that messages lie in.
const MESSAGES: &str = "data";

/// The memory of a publisher's messages.
#[derive(Debug)]
pub(crate) struct MessageMemory {
    file: File,
    path: PathBuf,
    topic: BusTopic,
    /// From one message to the next, bytes.
    stride: usize,
    /// Bytes of each message's items for which memory is taken.
    items_bytes: usize,
}

impl MessageMemory {
    /// That of a publisher that was just made, with memory for messages of a usual size.
    pub(crate) fn take(
        domain: &Domain,
        publisher: u128,
        topic: BusTopic,
        items_bytes: usize,
    ) -> Result<Self, Error> {
        let ending = format!("_{publisher}.{MESSAGES}");
        let mut segments = domain.files_in(Path::new(SHARED_MEMORY));
        let path = segments.find(|path| path.to_string_lossy().ends_with(&ending));
        let path = path.unwrap_or_else(|| Path::new(SHARED_MEMORY).join(&ending));
        let file = open(&path).map_err(Error::file(&path, "cannot be opened"))?;
        let largest = topic.head_bytes + qos::items_bytes_max(&topic).max(1);
        let mut memory = Self {
            file,
            path,
            stride: (size_of::<Header>() + largest).next_multiple_of(ALIGNMENT),
            topic,
            items_bytes: 0,
        };
        memory.grow(items_bytes)?;
        Ok(memory)
    }

    /// Takes memory for items of a size that did not come before.
    pub(crate) fn reserve(&mut self, items_bytes: usize) -> Result<(), Error> {
        if items_bytes <= self.items_bytes {
            return Ok(());
        }
        self.grow(items_bytes + items_bytes / GROWTH)
    }

    fn grow(&mut self, items_bytes: usize) -> Result<(), Error> {
        let items_bytes = items_bytes.min(qos::items_bytes_max(&self.topic));
        let used = size_of::<Header>() + self.topic.head_bytes + items_bytes + TABLE;
        let count = qos::living(&self.topic.qos);
        if used >= self.stride {
            self.allocate(0, count * self.stride + TABLE)?;
        } else {
            for message in 0..count {
                self.allocate(message * self.stride, used)?;
            }
        }
        self.items_bytes = items_bytes;
        Ok(())
    }

    fn allocate(&self, offset: usize, bytes: usize) -> Result<(), Error> {
        let length = self.file.metadata().map_or(0, |found| found.len());
        let bytes = (bytes as u64).min(length.saturating_sub(offset as u64));
        allocate(&self.file, offset as u64, bytes)
            .map_err(|cause| no_room(&self.path, self.topic.name, bytes, cause))
    }
}

/// The error if memory could not be taken.
fn no_room(path: &Path, what: &str, bytes: u64, cause: std::io::Error) -> Error {
    if cause.kind() != ErrorKind::StorageFull {
        return Error::file(path, "no memory for it")(cause);
    }
    Error::NoRoom {
        path: PathBuf::from(SHARED_MEMORY),
        what: what.to_owned(),
        free_mb: free_bytes(Path::new(SHARED_MEMORY)) as f64 * 1e-6,
        needed_mb: bytes as f64 * 1e-6,
    }
}

/// Takes the memory of all tables of a domain: those of services, notices, and connections of
/// ports.
pub(crate) fn take_tables(domain: &Domain) -> Result<(), Error> {
    for path in domain.files_in(Path::new(SHARED_MEMORY)) {
        if path.extension().is_some_and(|kind| kind == MESSAGES) {
            continue;
        }
        let mut bytes = 0;
        let taken = open(&path).and_then(|file| {
            bytes = file.metadata()?.len();
            allocate(&file, 0, bytes)
        });
        match taken {
            // Those of a port that has just left.
            Err(cause) if cause.kind() == ErrorKind::NotFound => {}
            taken => taken.map_err(|cause| no_room(&path, "a table of ports", bytes, cause))?,
        }
    }
    Ok(())
}

fn open(path: &Path) -> std::io::Result<File> {
    File::options().read(true).write(true).open(path)
}

fn allocate(file: &File, offset: u64, bytes: u64) -> std::io::Result<()> {
    if bytes == 0 {
        return Ok(());
    }
    Ok(fallocate(file, FallocateFlags::KEEP_SIZE, offset, bytes)?)
}
