//! What is in a journal and where, found by one walk over it.

use super::{Damage, Error, Kind, records};
use randt_messages::{Keyframe, MessageRef};
use std::fmt;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A journal's bytes, in memory or in a file that is mapped: a large one is not copied to be read.
pub type Bytes = Arc<dyn AsRef<[u8]> + Send + Sync>;

/// The payload of a keyframe's record.
#[derive(Clone)]
pub struct Packed {
    bytes: Bytes,
    at: Range<usize>,
}

impl Packed {
    /// Packs a keyframe that is in no journal yet.
    pub fn from_message(keyframe: MessageRef<'_, Keyframe>) -> Self {
        let mut bytes = Vec::new();
        super::keyframe::pack(keyframe, &mut bytes);
        Self::from(bytes)
    }
}

impl From<Vec<u8>> for Packed {
    fn from(bytes: Vec<u8>) -> Self {
        Self {
            at: 0..bytes.len(),
            bytes: Arc::new(bytes),
        }
    }
}

impl Deref for Packed {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        let bytes = (*self.bytes).as_ref();
        bytes.get(self.at.clone()).unwrap_or_default()
    }
}

impl fmt::Debug for Packed {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} packed bytes", self.len())
    }
}

/// A journal's records up to the first that is not whole.
#[derive(Debug, Default)]
pub struct Contents {
    /// Keyframes, in order.
    pub keyframes: Vec<Packed>,
    /// Snapshots, each with the number of keyframes before it.
    pub(crate) snapshots: Vec<(Packed, usize)>,
    /// How many bytes are good: header and whole records.
    pub good: usize,
    /// What is behind them.
    pub damage: Option<Damage>,
}

impl Contents {
    /// Reads a journal.
    pub fn read(bytes: &Bytes) -> Result<Self, Error> {
        let all = (**bytes).as_ref();
        let (_, mut records) = records(all)?;
        let mut contents = Self::default();
        while let Some(record) = records.next() {
            // The payload is the end of the record.
            let end = records.good();
            let packed = Packed {
                bytes: Arc::clone(bytes),
                at: end - record.payload.len()..end,
            };
            match record.kind {
                Kind::Keyframe => contents.keyframes.push(packed),
                Kind::Snapshot => {
                    let before = contents.keyframes.len();
                    contents.snapshots.push((packed, before));
                }
            }
        }
        contents.good = records.good();
        contents.damage = records.damage().cloned();
        Ok(contents)
    }
}
