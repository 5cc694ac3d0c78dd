//! The mapper's journal: its keyframes, and from time to time what it has made of them.
//!
//! Responsible for bytes from which [`Mapper::restore`] makes the mapper that was, to the last
//! bit, whenever its process was killed. Only [`JournalFile`] knows files; the rest turns values
//! into bytes and back.
//!
//! ```
//! use randt_config::Config;
//! use randt_mapper::{Mapper, journal};
//! use randt_messages::{Keyframe, Message};
//!
//! let config = Config::default();
//! let mut mapper = Mapper::new(&config);
//! let mut bytes = Vec::new();
//! journal::begin(&config, &mut bytes);
//! let keyframe = Message::<Keyframe>::default();
//! journal::append_keyframe(keyframe.as_ref(), &mut bytes)?;
//! mapper.push(keyframe.as_ref());
//! let (again, restored) = Mapper::restore(&config, &bytes)?;
//! assert_eq!((again.poses(), restored.replayed), (mapper.poses(), 1));
//! # Ok::<(), journal::Error>(())
//! ```

mod compaction;
mod contents;
mod error;
mod file;
mod header;
mod keyframe;
mod pack;
mod record;
mod tail;

pub use contents::{Bytes, Contents, Packed};
pub use error::Error;
pub use file::{Compacted, Compaction, JournalFile, Opened, Sync, Synced};
pub use header::{Header, MAGIC};
pub use keyframe::AttachedPose;
pub use record::{Damage, Kind, Record, Records};

use super::snapshot::Known;
use crate::Mapper;
use pack::Unpacker;
use randt_config::Config;
use randt_messages::{Keyframe, KeyframeHead, Message, MessageRef};

/// A snapshot costs about 32 bytes a keyframe of the map, and pushing a keyframe again some
/// milliseconds: at every 256th part of a map snapshots take half as much as the keyframes, and
/// few keyframes are left to push.
const SNAPSHOT_SHARE: u64 = 256;
/// ... but not for less than this.
const SNAPSHOT_EVERY_MIN: u64 = 4;

/// Whether a snapshot is due, by keyframes in the journal and those of them after its last
/// snapshot.
pub fn is_snapshot_due(keyframes: u64, after_snapshot: u64) -> bool {
    after_snapshot >= (keyframes / SNAPSHOT_SHARE).max(SNAPSHOT_EVERY_MIN)
}

/// Appends the header of a new journal.
pub fn begin(config: &Config, out: &mut Vec<u8>) {
    Header::new(config).append(out);
}

/// Appends a keyframe that the mapper has taken or is going to take.
pub fn append_keyframe(keyframe: MessageRef<'_, Keyframe>, out: &mut Vec<u8>) -> Result<(), Error> {
    let is_written = record::append(Kind::Keyframe, out, |out| keyframe::pack(keyframe, out));
    is_written.then_some(()).ok_or(Error::TooLarge)
}

/// Appends a snapshot of a mapper that has taken no keyframe but those before it, without what is
/// known from the snapshots before it in the journal. With nothing known it stands for itself.
pub fn append_snapshot(mapper: &Mapper, known: Known, out: &mut Vec<u8>) -> Result<(), Error> {
    let is_written = record::append(Kind::Snapshot, out, |out| mapper.snapshot(known, out));
    is_written.then_some(()).ok_or(Error::TooLarge)
}

/// Reads a journal's header and gives its records.
pub fn records(bytes: &[u8]) -> Result<(Header, Records<'_>), Error> {
    let (header, end) = Header::read(bytes)?;
    Ok((header, Records::new(bytes, end)))
}

/// Reads of the payload of a keyframe's record all but beams and points, over a head that keeps
/// its beams; `false` where it is none.
pub fn read_head(payload: &[u8], out: &mut KeyframeHead) -> bool {
    keyframe::unpack_numbers(&mut Unpacker(payload), out).is_some()
}

/// Reads where a keyframe stands of which a compacted journal has no more than its numbers.
pub fn read_attached(payload: &[u8]) -> Option<AttachedPose> {
    keyframe::unpack_attached(payload)
}

/// Reads the payload of a keyframe's record over a message; `false` where it is none.
pub fn read_keyframe(payload: &[u8], out: &mut Message<Keyframe>) -> bool {
    keyframe::unpack(payload, out).is_some()
}
