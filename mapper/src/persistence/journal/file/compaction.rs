//! A journal that is written anew beside the one that goes on.

use super::super::compaction::compact;
use super::super::{AttachedPose, Error};
use super::io_error;
use super::whole_file::{read_range, write_synced};
use std::fs::File;
use std::path::PathBuf;

/// A compaction that has begun. What it takes is time, so it may run on another thread; the
/// journal grows meanwhile.
#[derive(Debug)]
pub struct Compaction {
    /// The journal, wherever it is by now, up to the bytes that are replaced.
    pub(super) file: File,
    pub(super) until: u64,
    /// The new file until it takes its place.
    pub(super) new_path: PathBuf,
    pub(super) forgotten: Vec<(u64, AttachedPose)>,
    /// The record of a snapshot of all before.
    pub(super) snapshot: Vec<u8>,
}

/// What a compaction wrote, on the disk.
#[derive(Debug)]
pub struct Compacted {
    pub(super) new_path: PathBuf,
    /// Bytes of the old file that it stands for, and its own.
    pub(super) until: u64,
    pub(super) length: u64,
    pub(super) keyframe_bytes: u64,
    pub(super) snapshot_bytes: u64,
    /// Keyframes of which it has no more than their numbers.
    pub(super) forgotten: u64,
}

impl Compaction {
    /// Writes the new file and brings it onto the disk.
    pub fn run(self) -> Result<Compacted, Error> {
        let read = read_range(&self.file, 0..self.until);
        let old = read.map_err(|cause| io_error(&self.new_path, "read what it replaces", cause))?;
        let new = compact(&old, &self.forgotten, &self.snapshot)?;
        let written = write_synced(&self.new_path, &new);
        written.map_err(|cause| io_error(&self.new_path, "write", cause))?;
        let (length, snapshot_bytes) = (new.len() as u64, self.snapshot.len() as u64);
        Ok(Compacted {
            new_path: self.new_path,
            until: self.until,
            length,
            keyframe_bytes: length - snapshot_bytes,
            snapshot_bytes,
            forgotten: self.forgotten.len() as u64,
        })
    }
}
