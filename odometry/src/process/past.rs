//! What odometry keeps outside of its process: the whole state after every scan, the pose alone, the keyframes.

use super::outbox::{self, Into, Outbox};
use crate::Odometry;
use randt_config::Config;
use randt_messages::{Keyframe, Layout, Message, OdometryState, PoseRecord};
use randt_persist::Error as PersistError;
use randt_stage::{Checkpoint, Error, KeyframeRing, Stage};
use std::path::{Path, PathBuf};

/// Files in the domain's folder.
const STATE: &str = "odometry.state";
const RING: &str = "keyframes.ring";
/// The files that [`Past::read`] reads.
pub const RECORDS: [&str; 2] = [STATE, RING];
/// Room for the state: that of an iSDR-C takes under 1 MB, a Navtech's some more.
const STATE_BYTES: usize = 4 << 20;
/// Keyframes that are sent again after a restart; of older ones the mapper asks for what it lacks.
const AGAIN: u64 = 8;
/// Room for the pose.
const POSE_BYTES: usize = 8 + size_of::<PoseRecord>();

/// Why a past cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PastError {
    /// The records cannot be opened.
    #[error(transparent)]
    Stage(#[from] Error),
    /// The state cannot be taken over.
    #[error("odometry's last state: {0}")]
    Persist(#[from] PersistError),
    /// There is none.
    #[error("odometry left no state behind")]
    Nothing,
}

/// What a process left behind, as far as it is there.
#[derive(Debug)]
pub struct LeftBehind {
    /// The estimate with its window, or why there is none.
    pub odometry: Result<Odometry, PastError>,
    /// The last states that were published, oldest first.
    pub states: Vec<OdometryState>,
    /// The last keyframes; `None` where there never were any.
    pub ring: Option<Result<KeyframeRing, Error>>,
}

/// The records of one domain; their writer is the only one.
#[derive(Debug)]
pub struct Past {
    /// The last states that were published and the whole state, as one: either both are new or neither.
    state: Checkpoint,
    pose: Checkpoint,
    ring: KeyframeRing,
    folder: PathBuf,
    outbox: Outbox,
}

impl Past {
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

    /// What a stage that has ended left behind in a folder. Nothing is made there: where a file is missing, so is what it
    /// would tell.
    pub fn read(folder: &Path, config: &Config, use_imu: bool) -> LeftBehind {
        let (state, ring) = (folder.join(STATE), folder.join(RING));
        let mut left = LeftBehind {
            odometry: Err(PastError::Nothing),
            states: Vec::new(),
            ring: ring.is_file().then(|| KeyframeRing::open(&ring)),
        };
        if !state.is_file() {
            return left;
        }
        let state = match Checkpoint::open(&state, STATE_BYTES) {
            Ok(state) => state,
            Err(error) => {
                left.odometry = Err(error.into());
                return left;
            }
        };
        let newest = state.versions().into_iter().next();
        if let Some((sent, bytes)) = newest.and_then(|bytes| bytes.split_at_checked(outbox::BYTES))
        {
            left.states = Outbox::restore(sent).take_states().copied().collect();
            left.odometry = Odometry::restore(config, use_imu, bytes).map_err(PastError::from);
        }
        left
    }

    /// Goes on where the last process ended: with the whole state, else from the pose, else from nothing. Says which,
    /// and why.
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
                    // They are in the ring; whether they were sent nobody knows.
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
            self.set_aside(stage, &error, &bytes)?;
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
                // Whatever is in the ring is of a drive that nobody remembers.
                self.ring.clear();
                stage.log_info("begins anew");
                (Odometry::new(config, use_imu), false)
            }
        })
    }

    fn set_aside(&self, stage: &Stage, error: &PersistError, bytes: &[u8]) -> Result<(), Error> {
        let path = self.folder.join("odometry.state.aside");
        let kept = std::fs::write(&path, bytes);
        kept.map_err(|cause| Error::File {
            path: path.clone(),
            what: "cannot be written",
            cause,
        })?;
        stage.log_info(&format!("{error}; it is set aside as {}", path.display()));
        Ok(())
    }

    /// Where results go.
    pub(super) fn sink(&mut self) -> Into<'_> {
        Into {
            outbox: &mut self.outbox,
            ring: &mut self.ring,
        }
    }

    /// Keeps everything up to the present scan. To be called before anything of it is published.
    pub(super) fn keep(&mut self, odometry: &Odometry) -> Result<(), PersistError> {
        let outbox = &self.outbox;
        self.state.write(|slot| {
            let room = slot.len();
            let (sent, state) =
                slot.split_at_mut_checked(outbox::BYTES)
                    .ok_or(PersistError::Room {
                        needed: outbox::BYTES,
                        room,
                    })?;
            outbox.save(sent);
            Ok(outbox::BYTES + odometry.save(state)?)
        })?;
        let record = odometry.pose_record();
        self.pose.write(|slot| {
            let bytes = bytemuck::bytes_of(&record);
            let (layout, body) = slot.split_at_mut(8.min(slot.len()));
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
        // One that is not in the ring any more cannot be sent; the mapper sees that its number is missing.
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
