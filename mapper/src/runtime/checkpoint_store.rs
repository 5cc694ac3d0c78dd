//! The map as of the last keyframe, in memory: what the mapper has made since the journal's last
//! snapshot is made anew only after a power cut. In a large map of many loops that is seconds of
//! work.

use randt_stage::{Checkpoint, Error, Stage};

/// Room for the snapshot of some 100,000 keyframes, or of 10,000 with all that a first one has.
const BYTES_MAX: usize = 4 << 20;

/// What outlives the process beside the journal.
pub struct CheckpointStore(Checkpoint);

impl CheckpointStore {
    /// Opens or makes it.
    pub fn open(stage: &mut Stage) -> Result<Self, Error> {
        let path = stage.domain().state().join("mapper.map");
        stage.reserve(&path, 2 * BYTES_MAX)?;
        Ok(Self(Checkpoint::open(&path, BYTES_MAX)?))
    }

    /// The snapshot that was written last.
    pub fn newest(&self) -> Option<&[u8]> {
        self.0.versions().first().copied()
    }

    /// Writes one over the one before the last. One that is too large is not kept: the next start
    /// has more to do.
    pub fn store(&mut self, snapshot: &[u8]) {
        let _ = self.0.write(|slot| {
            let room = slot.get_mut(..snapshot.len()).ok_or(())?;
            room.copy_from_slice(snapshot);
            Ok::<usize, ()>(snapshot.len())
        });
    }
}
