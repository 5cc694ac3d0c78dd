//! What odometry saves outside of its process: the whole state after every scan, the pose alone,
//! the keyframes.

use super::outbox::{self, Outbox, ResultSink};
use crate::Odometry;
use randt_config::Config;
use randt_messages::{Keyframe, Layout, Message, OdometryState, PoseRecord};
use randt_persist::Error as PersistError;
use randt_stage::{Checkpoint, Error, KeyframeRing, Stage};
use std::path::{Path, PathBuf};

/// Files in the domain's folder.
const STATE: &str = "odometry.state";
const RING: &str = KeyframeRing::FILE;
/// The files that [`CheckpointStore::read`] reads.
pub const RECORDS: [&str; 2] = [STATE, RING];
/// Room for the state: that of an iSDR-C takes under 1 MB, that of a Navtech slightly more.
const STATE_BYTES: usize = 4 << 20;
/// Keyframes that are sent again after a restart; of older ones the mapper asks for what it lacks.
const AGAIN: u64 = 8;
/// Room for the pose.
const POSE_BYTES: usize = 8 + size_of::<PoseRecord>();

/// Why a checkpoint cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The records cannot be opened.
    #[error(transparent)]
    Stage(#[from] Error),
    /// The state cannot be taken over.
    #[error("odometry's last state: {0}")]
    Persist(#[from] PersistError),
    /// There is none.
    #[error("odometry has saved no state")]
    Missing,
}

/// What the records of a process that has ended hold, as far as they are there.
#[derive(Debug)]
pub struct CheckpointContents {
    /// The estimate with its window, or why there is none.
    pub odometry: Result<Odometry, CheckpointError>,
    /// The last states that were published, oldest first.
    pub states: Vec<OdometryState>,
    /// The last keyframes; `None` where there never were any.
    pub ring: Option<Result<KeyframeRing, Error>>,
}

/// The records of one domain; their writer is the only one.
#[derive(Debug)]
pub struct CheckpointStore {
    /// The last states that were published and the whole state, as one: either both are new or
    /// neither.
    state: Checkpoint,
    pose: Checkpoint,
    ring: KeyframeRing,
    folder: PathBuf,
    outbox: Outbox,
}

impl CheckpointStore {
    /// Opens or makes the records.
    pub fn open(stage: &mut Stage) -> Result<Self, Error> {
        let folder = stage.domain().state();
        stage.reserve(&folder.join(STATE), 2 * STATE_BYTES)?;
        stage.reserve(&folder.join(RING), KeyframeRing::BYTES)?;
        Self::at(&folder)
    }

    fn at(folder: &Path) -> Result<Self, Error> {
        Ok(Self {
            state: Checkpoint::open(&folder.join(STATE), STATE_BYTES)?,
            pose: Checkpoint::open(&folder.join("odometry.pose"), POSE_BYTES)?,
            ring: KeyframeRing::open(&folder.join(RING))?,
            folder: folder.to_owned(),
            outbox: Outbox::default(),
        })
    }

    /// Reads the records of a stage that has ended from a folder. No file is made there; a missing
    /// one gives nothing.
    pub fn read(folder: &Path, config: &Config, use_imu: bool) -> CheckpointContents {
        let (state, ring) = (folder.join(STATE), folder.join(RING));
        let mut contents = CheckpointContents {
            odometry: Err(CheckpointError::Missing),
            states: Vec::new(),
            ring: ring.is_file().then(|| KeyframeRing::open(&ring)),
        };
        if !state.is_file() {
            return contents;
        }
        let state = match Checkpoint::open(&state, STATE_BYTES) {
            Ok(state) => state,
            Err(error) => {
                contents.odometry = Err(error.into());
                return contents;
            }
        };
        let newest = state.versions().into_iter().next();
        if let Some((sent, bytes)) = newest.and_then(|bytes| bytes.split_at_checked(outbox::BYTES))
        {
            contents.states = Outbox::restore(sent).take_states().copied().collect();
            contents.odometry =
                Odometry::restore(config, use_imu, bytes).map_err(CheckpointError::from);
        }
        contents
    }

    /// Goes on where the last process ended: with the whole state, else from the pose, else anew;
    /// logs which, and why. Gives whether there was a state or a pose.
    pub fn restore(
        &mut self,
        stage: &Stage,
        config: &Config,
        use_imu: bool,
    ) -> Result<(Odometry, bool), Error> {
        let mut refused = None;
        for bytes in self.state.versions() {
            let Some((sent, state)) = bytes.split_at_checked(outbox::BYTES) else {
                continue;
            };
            match Odometry::restore(config, use_imu, state) {
                Ok(odometry) => {
                    self.outbox = Outbox::restore(sent);
                    // They are in the ring; whether they were sent is unknown.
                    let next = odometry.pose_record().next_keyframe;
                    self.outbox.keyframes = (next.saturating_sub(AGAIN)..next).collect();
                    stage.log_info(&format!(
                        "goes on after scan {}, state and map as they were",
                        odometry.last_scan().unwrap_or_default().sequence
                    ));
                    return Ok((odometry, true));
                }
                Err(error) => refused = refused.or(Some((error, bytes.to_vec()))),
            }
        }
        if let Some((error, bytes)) = refused {
            self.quarantine(stage, &error, &bytes)?;
        }
        let newest = self.pose.versions().into_iter().next();
        Ok(match newest.and_then(read_pose) {
            Some(record) => {
                stage.log_info(&format!(
                    "begins frame {} at the last pose {:?}; keyframes go on at {}",
                    record.odom_frame_id + 1,
                    record.pose,
                    record.next_keyframe
                ));
                (Odometry::resume(config, use_imu, &record), true)
            }
            None => {
                // What is in the ring belongs to a drive whose state is lost.
                self.ring.clear();
                stage.log_info("begins anew");
                (Odometry::new(config, use_imu), false)
            }
        })
    }

    fn quarantine(&self, stage: &Stage, error: &PersistError, bytes: &[u8]) -> Result<(), Error> {
        let path = self.folder.join("odometry.state.quarantined");
        let written = std::fs::write(&path, bytes);
        written.map_err(|cause| Error::File {
            path: path.clone(),
            what: "cannot be written",
            cause,
        })?;
        stage.log_info(&format!("{error}; it is quarantined as {}", path.display()));
        Ok(())
    }

    /// Where results go.
    pub(super) fn sink(&mut self) -> ResultSink<'_> {
        ResultSink {
            outbox: &mut self.outbox,
            ring: &mut self.ring,
        }
    }

    /// Saves everything up to the present scan. To be called before any of its results is
    /// published.
    pub(super) fn save(&mut self, odometry: &Odometry) -> Result<(), PersistError> {
        let outbox = &self.outbox;
        self.state.write(|bytes| {
            let room = bytes.len();
            let (sent, state) =
                bytes
                    .split_at_mut_checked(outbox::BYTES)
                    .ok_or(PersistError::Room {
                        needed: outbox::BYTES,
                        room,
                    })?;
            outbox.save(sent);
            Ok(outbox::BYTES + odometry.save(state)?)
        })?;
        let record = odometry.pose_record();
        self.pose.write(|room| {
            let bytes = bytemuck::bytes_of(&record);
            let (layout, body) = room.split_at_mut(8.min(room.len()));
            layout.copy_from_slice(&PoseRecord::HASH.to_le_bytes()[..layout.len()]);
            for (to, from) in body.iter_mut().zip(bytes) {
                *to = *from;
            }
            Ok(POSE_BYTES)
        })
    }

    /// What is to be published.
    pub fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    /// The next keyframe that has not been published.
    pub fn next_keyframe(&mut self) -> Option<Message<Keyframe>> {
        // One that is not in the ring any more cannot be sent; the mapper sees that its number is
        // missing.
        std::iter::from_fn(|| self.outbox.keyframes.pop_front()).find_map(|id| self.ring.get(id))
    }

    /// The keyframes.
    pub fn ring(&self) -> &KeyframeRing {
        &self.ring
    }
}

/// A pose record of this layout.
fn read_pose(bytes: &[u8]) -> Option<PoseRecord> {
    let (layout, record) = bytes.split_at_checked(8)?;
    (layout == PoseRecord::HASH.to_le_bytes())
        .then(|| bytemuck::try_pod_read_unaligned(record).ok())
        .flatten()
}
