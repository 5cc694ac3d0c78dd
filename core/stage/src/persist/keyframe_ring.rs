//! The ring of keyframes: in memory, outside of every process, until the mapper has them on disk.

use super::mapped_file::MappedFile;
use crate::Error;
use bytemuck::{Pod, Zeroable};
use randt_messages::{Keyframe, Message, MessageRef, Topic};
use std::path::Path;

/// Keyframes that are listed; more than the memory below holds.
const ENTRIES: usize = 1024;
/// Memory for them: some 250 of an iSDR-C, two minutes at walking pace.
const BYTES: usize = 12 << 20;
/// The list lies before the keyframes.
const LIST: usize = ENTRIES * size_of::<Entry>();

/// Where a keyframe lies.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    /// Number of the keyframe + 1; 0 for none.
    number: u64,
    offset: u64,
    length: u64,
    /// Over number and bytes: an entry whose bytes were written over is none.
    crc: u32,
    reserved: u32,
}

/// The last keyframes, whole, however their writer ended.
#[derive(Debug)]
pub struct KeyframeRing {
    file: MappedFile,
    /// Where the next one goes.
    next: usize,
    bytes: Vec<u8>,
}

impl KeyframeRing {
    /// Memory of a ring.
    pub const BYTES: usize = LIST + BYTES;
    /// Its file in the run folder's `state`.
    pub const FILE: &str = "keyframes.ring";

    /// Opens or makes the ring; its writer is the only one.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut ring = Self {
            file: MappedFile::open(path, LIST + BYTES)?,
            next: LIST,
            bytes: Vec::new(),
        };
        // A writer that was killed while it wrote the list may have left an entry that points
        // anywhere.
        ring.next = ring.newest_whole().map_or(LIST, |e| end(&e));
        Ok(ring)
    }

    /// The keyframes from one number to before another one, in order, as far as they are there, for
    /// a process that is not its writer. What the writer is just writing over is not among them.
    pub fn read(path: &Path, from: u64, to: u64) -> Vec<Message<Keyframe>> {
        let Ok(bytes) = std::fs::read(path) else {
            return Vec::new();
        };
        let mut ids: Vec<u64> = entries(&bytes).map(|entry| entry.number - 1).collect();
        ids.retain(|id| (from..to).contains(id));
        ids.sort_unstable();
        ids.into_iter().filter_map(|id| find(&bytes, id)).collect()
    }

    /// Removes all keyframes: they belong to another drive.
    pub fn clear(&mut self) {
        self.file.bytes_mut().fill(0);
        self.next = LIST;
    }

    /// Adds a keyframe; the same number once more replaces it.
    pub fn push(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.bytes.clear();
        keyframe.write_bytes(&mut self.bytes);
        let length = self.bytes.len();
        if self.next + length > LIST + BYTES {
            self.next = LIST;
        }
        let (at, id) = (self.next, keyframe.head.id);
        let entry = Entry {
            number: id + 1,
            offset: at as u64,
            length: length as u64,
            crc: checksum(id + 1, &self.bytes),
            reserved: 0,
        };
        let map = self.file.bytes_mut();
        let Some(space) = map.get_mut(at..at + length) else {
            return;
        };
        space.copy_from_slice(&self.bytes);
        let entry_at = entry_offset(id);
        if let Some(listed) = map.get_mut(entry_at..entry_at + size_of::<Entry>()) {
            listed.copy_from_slice(bytemuck::bytes_of(&entry));
        }
        self.next = at + length;
    }

    /// A keyframe, where it is still there.
    pub fn get(&self, id: u64) -> Option<Message<Keyframe>> {
        find(self.file.bytes(), id)
    }

    /// Number of the newest keyframe.
    pub fn newest(&self) -> Option<u64> {
        self.entries().map(|entry| entry.number - 1).max()
    }

    fn newest_whole(&self) -> Option<Entry> {
        let mut entries: Vec<Entry> = self.entries().collect();
        entries.sort_unstable_by_key(|entry| std::cmp::Reverse(entry.number));
        entries
            .into_iter()
            .find(|entry| self.get(entry.number - 1).is_some())
    }

    fn entries(&self) -> impl Iterator<Item = Entry> {
        entries(self.file.bytes())
    }
}

/// A keyframe in the bytes of a ring.
fn find(bytes: &[u8], id: u64) -> Option<Message<Keyframe>> {
    let entry = entry_at(bytes, entry_offset(id))?;
    let keyframe = bytes.get(entry.offset as usize..end(&entry))?;
    let whole = entry.number == id + 1 && checksum(entry.number, keyframe) == entry.crc;
    whole.then(|| Message::from_bytes(keyframe)).flatten()
}

fn entries(bytes: &[u8]) -> impl Iterator<Item = Entry> {
    (0..ENTRIES as u64)
        .filter_map(|id| entry_at(bytes, entry_offset(id)))
        .filter(|entry| entry.number > 0)
}

fn entry_at(bytes: &[u8], at: usize) -> Option<Entry> {
    let entry = bytes.get(at..at + size_of::<Entry>())?;
    let entry: Entry = bytemuck::pod_read_unaligned(entry);
    let inside = end(&entry) <= LIST + BYTES && entry.offset as usize >= LIST;
    (entry.number == 0 || inside).then_some(entry)
}

fn entry_offset(id: u64) -> usize {
    (id % ENTRIES as u64) as usize * size_of::<Entry>()
}

fn end(entry: &Entry) -> usize {
    entry.offset.saturating_add(entry.length) as usize
}

fn checksum(number: u64, bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&number.to_le_bytes());
    hasher.update(bytes);
    hasher.finalize()
}

// The largest keyframe must fit with room to spare.
const _: () =
    assert!(BYTES > 4 * (size_of::<<Keyframe as Topic>::Head>() + 16 * Keyframe::MAX_ITEMS));

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::KeyframePoint;

    fn keyframe(id: u64, points: usize) -> Message<Keyframe> {
        let mut message = Message::<Keyframe>::default();
        message.head.id = id;
        message.head.pose = [id as f64, 0.5, -0.25];
        message.items = vec![
            KeyframePoint {
                x_m: id as f32,
                ..KeyframePoint::default()
            };
            points
        ];
        message
    }

    #[test]
    fn keyframes_survive_their_writer_and_old_ones_make_room() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ring");
        let mut ring = KeyframeRing::open(&path).unwrap();
        assert_eq!(ring.newest(), None);
        for id in 0..900 {
            ring.push(keyframe(id, 1500 + id as usize % 7).as_ref());
        }
        drop(ring);
        let mut ring = KeyframeRing::open(&path).unwrap();
        assert_eq!(ring.newest(), Some(899));
        let there: Vec<u64> = (0..900).filter(|&id| ring.get(id).is_some()).collect();
        // The last ones, without a gap.
        assert!(there.len() > 200 && there[0] == 900 - there.len() as u64);
        for &id in &there {
            assert_eq!(ring.get(id), Some(keyframe(id, 1500 + id as usize % 7)));
        }
        let read = KeyframeRing::read(&path, 0, 898);
        assert_eq!(read.len() + 2, there.len(), "while it is in use");
        assert_eq!(read.last(), Some(&keyframe(897, 1500 + 897 % 7)));
        ring.push(keyframe(899, 10).as_ref());
        ring.push(keyframe(900, 20).as_ref());
        assert_eq!(ring.get(899), Some(keyframe(899, 10)));
        assert_eq!(ring.get(900), Some(keyframe(900, 20)));
        assert_eq!(ring.get(898), Some(keyframe(898, 1500 + 898 % 7)));
        ring.clear();
        assert_eq!(ring.newest(), None);
    }
}
