//! How far the files of a folder reach, kept outside of the process for the next recorder.
//!
//! Only with the feature `runtime`.

use crate::Positions;
use randt_messages::layout::{FNV_SEED, hash_bytes};
use randt_stage::{Checkpoint, Error, Stage};
use std::convert::Infallible;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// In the domain's folder.
const FILE: &str = "recorder.positions";
/// Which folder it is, and the positions.
const BYTES: usize = size_of::<u64>() + Positions::BYTES_MAX;

/// The record. It is lost with the machine's memory, as are the publishers whose messages it
/// counts.
#[derive(Debug)]
pub struct PositionStore {
    checkpoint: Checkpoint,
    folder: u64,
    kept: Positions,
}

impl PositionStore {
    /// Opens or makes it; for another folder than the last recorder's it is empty: those files are
    /// another recording.
    pub fn open(stage: &mut Stage, folder: &Path) -> Result<Self, Error> {
        let path = stage.domain().state().join(FILE);
        stage.reserve(&path, 2 * BYTES)?;
        let checkpoint = Checkpoint::open(&path, BYTES)?;
        let folder = identity(folder);
        let newest = checkpoint.versions().into_iter().next();
        let kept = newest.and_then(|bytes| {
            let (owner, positions) = bytes.split_first_chunk()?;
            (u64::from_le_bytes(*owner) == folder).then(|| Positions::read(positions))?
        });
        Ok(Self {
            checkpoint,
            folder,
            kept: kept.unwrap_or_default(),
        })
    }

    /// What the files hold.
    pub fn positions(&self) -> &Positions {
        &self.kept
    }

    /// Keeps what they hold by now, where that is something else.
    pub fn keep(&mut self, positions: &Positions) {
        if *positions == self.kept {
            return;
        }
        self.kept.clone_from(positions);
        let folder = self.folder.to_le_bytes();
        let Ok(()) = self.checkpoint.write(|out| {
            let Some((owner, rest)) = out.split_first_chunk_mut() else {
                return Ok::<_, Infallible>(0);
            };
            *owner = folder;
            Ok(folder.len() + positions.write(rest))
        });
    }
}

/// The same for one folder by whichever path it is reached, and another for every other one.
fn identity(folder: &Path) -> u64 {
    // The path of a folder that cannot be made yet is taken as it is.
    let _ = fs::create_dir_all(folder);
    let absolute = || std::path::absolute(folder).unwrap_or_else(|_| PathBuf::from(folder));
    let path = fs::canonicalize(folder).unwrap_or_else(|_| absolute());
    hash_bytes(FNV_SEED, path.as_os_str().as_bytes())
}
