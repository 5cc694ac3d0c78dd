//! A record that outlives its writer: the last two versions in a file in memory.

use super::mapped_file::MappedFile;
use crate::Error;
use bytemuck::{Pod, Zeroable};
use std::path::Path;

/// Space for the head of a slot.
const HEAD: usize = 64;

/// The head of a slot.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    /// Rises with every version, from 1.
    number: u64,
    length: u64,
    /// Over number, length and bytes.
    crc: u32,
    reserved: u32,
}

/// The last two versions of a record. A writer may be killed between any two stores: one of them
/// is always whole.
#[derive(Debug)]
pub struct Checkpoint {
    file: MappedFile,
    slot_bytes: usize,
    number: u64,
}

impl Checkpoint {
    /// Opens or makes the file, with room for versions of up to `capacity` bytes; its writer is
    /// the only one.
    pub fn open(path: &Path, capacity: usize) -> Result<Self, Error> {
        let slot_bytes = HEAD + capacity.next_multiple_of(64);
        let mut checkpoint = Self {
            file: MappedFile::open(path, 2 * slot_bytes)?,
            slot_bytes,
            number: 0,
        };
        let newest = checkpoint.whole_slots().first().map(|(number, _)| *number);
        checkpoint.number = newest.unwrap_or(0);
        Ok(checkpoint)
    }

    /// The newest whole version, and the one before where that is whole too.
    pub fn versions(&self) -> Vec<&[u8]> {
        let slots = self.whole_slots().into_iter();
        slots.map(|(_, bytes)| bytes).collect()
    }

    /// Writes a version: `fill` gets the slot of the older one and gives the number of bytes.
    /// Where it fails, the newer one stays.
    pub fn write<E>(&mut self, fill: impl FnOnce(&mut [u8]) -> Result<usize, E>) -> Result<(), E> {
        let number = self.number + 1;
        let at = (number % 2) as usize * self.slot_bytes;
        let slot = self.file.bytes_mut().get_mut(at..at + self.slot_bytes);
        let Some((head, body)) = slot.and_then(|slot| slot.split_at_mut_checked(HEAD)) else {
            return Ok(());
        };
        // Not whole until the new head is there.
        head.fill(0);
        let length = fill(body)?.min(body.len());
        let whole = Head {
            number,
            length: length as u64,
            crc: checksum(number, body.get(..length).unwrap_or_default()),
            reserved: 0,
        };
        for (to, from) in head.iter_mut().zip(bytemuck::bytes_of(&whole)) {
            *to = *from;
        }
        self.number = number;
        Ok(())
    }

    /// The newest first.
    fn whole_slots(&self) -> Vec<(u64, &[u8])> {
        let mut slots: Vec<_> = (0..2).filter_map(|slot| self.slot(slot)).collect();
        slots.sort_by_key(|(number, _)| std::cmp::Reverse(*number));
        slots
    }

    /// Number and bytes of a slot, where it is whole.
    fn slot(&self, slot: usize) -> Option<(u64, &[u8])> {
        let at = slot * self.slot_bytes;
        let slot = self.file.bytes().get(at..at + self.slot_bytes)?;
        let (head, body) = slot.split_at_checked(HEAD)?;
        let head: Head = bytemuck::pod_read_unaligned(head.get(..size_of::<Head>())?);
        let bytes = body.get(..usize::try_from(head.length).ok()?)?;
        let is_whole = head.number > 0 && head.crc == checksum(head.number, bytes);
        is_whole.then_some((head.number, bytes))
    }
}

fn checksum(number: u64, bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&number.to_le_bytes());
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn put(checkpoint: &mut Checkpoint, text: &[u8]) {
        let written = checkpoint.write(|slot| {
            slot[..text.len()].copy_from_slice(text);
            Ok::<_, Infallible>(text.len())
        });
        written.unwrap();
    }

    #[test]
    fn the_last_two_versions_survive_their_writer() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record");
        let mut checkpoint = Checkpoint::open(&path, 100).unwrap();
        assert!(checkpoint.versions().is_empty());
        for text in [&b"one"[..], b"two", b"three"] {
            put(&mut checkpoint, text);
        }
        assert!(Checkpoint::open(&path, 100).is_err(), "one writer");
        drop(checkpoint);
        let mut again = Checkpoint::open(&path, 100).unwrap();
        assert_eq!(again.versions(), [&b"three"[..], b"two"]);
        put(&mut again, b"four");
        assert_eq!(again.versions(), [&b"four"[..], b"three"]);
    }

    #[test]
    fn a_version_that_was_cut_short_leaves_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record");
        let mut checkpoint = Checkpoint::open(&path, 100).unwrap();
        put(&mut checkpoint, b"whole");
        let failed = checkpoint.write(|slot| {
            slot[..7].copy_from_slice(b"half do");
            Err("killed here")
        });
        assert!(failed.is_err());
        assert_eq!(checkpoint.versions(), [b"whole"]);
        // Damage anywhere in the newest one is noticed.
        put(&mut checkpoint, b"newest");
        let at = checkpoint.slot_bytes * (checkpoint.number % 2) as usize;
        for offset in [0, 8, 16, HEAD, HEAD + 5] {
            let byte = &mut checkpoint.file.bytes_mut()[at + offset];
            *byte ^= 1;
            assert_eq!(checkpoint.versions(), [b"whole"], "{offset}");
            checkpoint.file.bytes_mut()[at + offset] ^= 1;
        }
        assert_eq!(checkpoint.versions().len(), 2);
    }
}
