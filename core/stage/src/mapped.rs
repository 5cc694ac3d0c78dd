//! A file in memory that a process writes by storing, not by calling the system: what it wrote last is there when it
//! is killed; and a large file that is read without being copied. The only place that maps files.

use crate::Error;
use memmap2::{Mmap, MmapMut, MmapOptions};
use std::fs::File;
use std::path::Path;

/// A file of fixed size, mapped.
#[derive(Debug)]
pub(crate) struct Mapped {
    map: MmapMut,
    // The lock goes with the file.
    _file: File,
}

impl Mapped {
    /// Opens or makes a file of `bytes`; one of another size is made anew. `exclusive`: for the one who writes.
    pub(crate) fn open(path: &Path, bytes: usize, exclusive: bool) -> Result<Self, Error> {
        let file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)
            .map_err(Error::file(path, "cannot be opened"))?;
        if exclusive {
            let locked = file.try_lock().map_err(std::io::Error::from);
            locked.map_err(Error::file(path, "is in use by another process"))?;
        }
        let found = file
            .metadata()
            .map_err(Error::file(path, "cannot be read"))?;
        if found.len() != bytes as u64 {
            file.set_len(0)
                .map_err(Error::file(path, "cannot be emptied"))?;
        }
        // Memory is taken now: where there is none left, a later store would be the end of the process.
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes as u64)
            .map_err(|cause| Error::file(path, "no memory left for it")(cause.into()))?;
        Ok(Self {
            map: map(&file).map_err(Error::file(path, "cannot be mapped"))?,
            _file: file,
        })
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &self.map
    }

    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.map
    }
}

/// The bytes of a file. Whoever takes them has locked it, so that it grows meanwhile and no more than that.
#[derive(Debug)]
pub struct FileBytes(Option<Mmap>);

impl FileBytes {
    /// Of the file as it is now.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let file = File::open(path)?;
        match file.metadata()?.len() {
            // There is nothing that could be mapped.
            0 => Ok(Self(None)),
            _ => map_to_read(&file).map(|map| Self(Some(map))),
        }
    }
}

impl AsRef<[u8]> for FileBytes {
    fn as_ref(&self) -> &[u8] {
        self.0.as_deref().unwrap_or_default()
    }
}

// SAFETY: as below; here the caller holds a lock of the file's own, which the mapper's journal has, and of that file
// nothing but the end is ever written, or cut where no whole record stands. A disk that fails under it ends the process,
// as a failing read would have when it began.
#[allow(unsafe_code)]
fn map_to_read(file: &File) -> std::io::Result<Mmap> {
    unsafe { MmapOptions::new().populate().map(file) }
}

// SAFETY: a mapping is unsound where somebody else changes or cuts the file while it is borrowed as a slice. These files
// lie in the realm's folder (mode 0700) and are written by the one process that holds their lock; they are never cut
// while it lives, and their memory is allocated. Readers that do not hold the lock copy and check a checksum.
#[allow(unsafe_code)]
fn map(file: &File) -> std::io::Result<MmapMut> {
    unsafe { MmapMut::map_mut(file) }
}
