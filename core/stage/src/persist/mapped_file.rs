//! A file in memory that a process writes by storing, not by calling the system: what it wrote
//! last is there when it is killed; and a large file that is read without being copied. The only
//! place that maps files.

use crate::{Error, domain::open_private};
use memmap2::{Mmap, MmapMut, MmapOptions};
use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Bits of a file's mode by which its group and all others may write to it.
const WRITTEN_BY_OTHERS: u32 = 0o022;

/// A file of fixed size, mapped.
#[derive(Debug)]
pub(crate) struct MappedFile {
    map: MmapMut,
    // The lock goes with the file.
    _file: File,
}

impl MappedFile {
    /// Opens or makes a file of `bytes` for its only writer; one of another size is made anew.
    pub(crate) fn open(path: &Path, bytes: usize) -> Result<Self, Error> {
        let file = open_private(path)?;
        let locked = file.try_lock().map_err(std::io::Error::from);
        locked.map_err(Error::file(path, "is in use by another process"))?;
        let found = file.metadata();
        let found = found.map_err(Error::file(path, "cannot be read"))?;
        if found.len() != bytes as u64 {
            let emptied = file.set_len(0);
            emptied.map_err(Error::file(path, "cannot be emptied"))?;
        }
        // Memory is taken now: if none is left, a later store would end the process.
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

/// The bytes of a file that only grows. Its reader has locked it against other readers and
/// writers.
#[derive(Debug)]
pub enum FileBytes {
    /// As they lie on the disk.
    Mapped(Mmap),
    /// A copy: the file is empty, or others could write to it.
    Read(Vec<u8>),
}

impl FileBytes {
    /// The bytes of the file as it is now.
    pub fn open(path: &Path) -> std::io::Result<Self> {
        let file = File::open(path)?;
        let found = file.metadata()?;
        let is_own = found.uid() == rustix::process::geteuid().as_raw();
        if found.len() == 0 || !is_own || found.mode() & WRITTEN_BY_OTHERS != 0 {
            return Ok(Self::Read(std::fs::read(path)?));
        }
        Ok(Self::Mapped(map_to_read(&file)?))
    }
}

impl AsRef<[u8]> for FileBytes {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Read(bytes) => bytes,
        }
    }
}

// SAFETY: as below. Only this user can write to the file; of this user's programs the one that
// holds the file's lock appends, and cuts where no whole record is, behind all that is ever read.
// What remains is a user who writes over the file by hand, and a disk that fails: both end the
// process with a signal.
#[allow(unsafe_code)]
fn map_to_read(file: &File) -> std::io::Result<Mmap> {
    unsafe { MmapOptions::new().populate().map(file) }
}

// SAFETY: a mapping is unsound if another process changes or cuts the file while it is borrowed as
// a slice. These files lie in the domain's folder (mode 0700) and are written by the one process
// that holds their lock; they are never cut while it lives, and their memory is allocated. Readers
// that do not hold the lock copy and check a checksum.
#[allow(unsafe_code)]
fn map(file: &File) -> std::io::Result<MmapMut> {
    unsafe { MmapMut::map_mut(file) }
}

#[cfg(test)]
mod tests {
    use super::FileBytes;
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_what_no_other_user_can_write_to_is_mapped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        assert!(FileBytes::open(&path).is_err());
        fs::write(&path, b"").unwrap();
        assert_eq!(FileBytes::open(&path).unwrap().as_ref(), b"");
        fs::write(&path, b"some bytes").unwrap();
        for (mode, is_mapped) in [(0o600, true), (0o644, true), (0o660, false), (0o602, false)] {
            fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            let bytes = FileBytes::open(&path).unwrap();
            assert_eq!(bytes.as_ref(), b"some bytes");
            assert_eq!(matches!(bytes, FileBytes::Mapped(_)), is_mapped, "{mode:o}");
        }
    }
}
