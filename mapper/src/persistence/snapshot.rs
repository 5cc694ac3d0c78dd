//! What cannot be made again from keyframes alone: where they are in the map, and what became of
//! every closure.
//!
//! Constraints of odometry, submaps, descriptors and the grid follow from keyframes and poses. Of
//! closures only their status ever changes, and ring keys do not, so a snapshot has those that
//! came after the one before it: a twentieth of all. Keys are there though they follow from
//! keyframes, because each search looks through all of them: a mapper that comes back would have
//! to unpack its whole journal.

use crate::Mapper;
use crate::place_recognition::RingKey;
use crate::verification::{LoopClosure, LoopStatus};
use randt_persist::{Error, Persist, Reader, StateIdentity, Writer, encode, persist};

/// First bytes of a snapshot.
const MAGIC: [u8; 8] = *b"RANDTSNP";
/// What a snapshot looks like: its number is to be raised with every change of what is saved,
/// which a test notices. The build does not matter: another one's map is a map, and pushing
/// thousands of keyframes anew takes minutes in which a robot that was updated has none. Forms 1
/// and 2 had no magic.
const FORM: [u8; 16] = *b"mapper snapshot3";

/// How much the snapshots of a journal have of what only grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Known {
    closures: usize,
    keys: usize,
}
persist!(Known { closures, keys });

/// What only grows, from what was known on; with the snapshots before it, all that there is.
#[derive(Debug, Default)]
struct Increment {
    known: Known,
    closures: Vec<LoopClosure>,
    keys: Vec<RingKey>,
}
persist!(Increment {
    known,
    closures,
    keys
});

/// What only grows, all of it.
#[derive(Debug, Default)]
pub(super) struct Grown {
    pub closures: Vec<LoopClosure>,
    pub keys: Vec<RingKey>,
}

impl Grown {
    /// Takes the next snapshot's increment; `None` where something between is missing.
    fn take(&mut self, increment: Increment) -> Option<()> {
        let known = increment.known;
        if known.closures > self.closures.len() || known.keys > self.keys.len() {
            return None;
        }
        self.closures.truncate(known.closures);
        self.closures.extend(increment.closures);
        self.keys.truncate(known.keys);
        self.keys.extend(increment.keys);
        Some(())
    }
}

/// A snapshot whose increment is still to be read.
pub(super) struct Opened<'a> {
    /// Keyframes that its mapper had taken.
    pub taken: u64,
    pub rest: Reader<'a>,
}

impl<'a> Opened<'a> {
    /// Opens a snapshot of this form and configuration.
    pub fn new(fingerprint: u64, bytes: &'a [u8]) -> Result<Self, Error> {
        let mut rest = randt_persist::decode(&identity(fingerprint), bytes)?;
        let mut taken = 0_u64;
        taken.restore(&mut rest)?;
        Ok(Self { taken, rest })
    }

    /// Adds its increment to what the snapshots before it have.
    pub fn add_to(&mut self, grown: &mut Grown) -> Option<()> {
        let mut increment = Increment::default();
        increment.restore(&mut self.rest).ok()?;
        grown.take(increment)
    }
}

fn identity(fingerprint: u64) -> StateIdentity {
    StateIdentity {
        magic: MAGIC,
        code: FORM,
        config: fingerprint,
    }
}

impl Mapper {
    /// What a journal knows of it that has a snapshot of now.
    pub fn known(&self) -> Known {
        Known {
            closures: self.closures().len(),
            keys: self.recognition.keys().len(),
        }
    }

    /// Appends what [`Mapper::restore`] needs beside the keyframes and what the snapshots before
    /// it have.
    pub(crate) fn snapshot(&self, known: Known, out: &mut Vec<u8>) {
        let (closures, keys) = (self.closures(), self.recognition.keys());
        let increment = Increment {
            known,
            closures: closures.get(known.closures..).unwrap_or_default().to_vec(),
            keys: keys.get(known.keys..).unwrap_or_default().to_vec(),
        };
        let statuses: Vec<LoopStatus> = closures.iter().map(|closure| closure.status).collect();
        let (keyframes, graph) = (self.keyframes.saved(), self.graph.saved());
        let save = |out: &mut Writer<'_>| {
            (self.taken() as u64).save(out);
            increment.save(out);
            keyframes.save(out);
            statuses.save(out);
            graph.save(out);
            self.recognition.save(out);
            self.merger.save(out);
            self.version.save(out);
        };
        let identity = identity(self.fingerprint);
        if let Err(Error::Room { needed, .. }) = encode(&identity, &mut [], save) {
            let start = out.len();
            out.resize(start + needed, 0);
            // There is room for what is needed: it cannot fail.
            let _ = encode(&identity, out.get_mut(start..).unwrap_or_default(), save);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{CandidateIdx, KeyframeIdx};
    use crate::place_recognition::CandidateOrigin;
    use crate::verification::Scores;
    use nalgebra::Matrix3;
    use randt_config::Config;
    use randt_geometry::Pose2;
    use randt_messages::{Keyframe, Message};

    /// A change of what is saved raises the number in `FORM` and writes the new sum here: an older
    /// snapshot would else be read as something that it is not.
    #[test]
    fn form_three_is_as_it_was() {
        let mut mapper = Mapper::new(&Config::default());
        for id in [0, 1, 300] {
            let mut message = Message::<Keyframe>::default();
            message.head.id = id;
            message.head.header.stamp_ns = 1_700_000_000_000_000_000 + id as i64;
            message.head.pose = [0.5 * id as f64, 0.0, 0.25];
            assert!(mapper.push(message.as_ref()));
        }
        let closure = LoopClosure {
            older: KeyframeIdx(0),
            newer: KeyframeIdx(2),
            origin: CandidateOrigin::Appearance {
                distance: 0.25,
                yaw_rad: 1.5,
            },
            older_from_newer: Pose2::from_array([1.0, 2.0, 0.5]),
            information: Matrix3::identity(),
            scores: Scores {
                forward: Some(0.5),
                chi2: Some(2.0),
                ..Scores::default()
            },
            status: LoopStatus::Withdrawn,
        };
        mapper.verification.restore(vec![closure, closure]);
        let added = mapper.graph.add_closure(CandidateIdx(1), closure.edge());
        assert!(added.is_ok());
        let known = Known {
            closures: 1,
            keys: 2,
        };
        let mut bytes = Vec::new();
        mapper.snapshot(known, &mut bytes);
        assert!(Opened::new(mapper.fingerprint, &bytes).is_ok());
        // Behind the envelope, which has the configuration in it.
        let state = &bytes[48..];
        assert_eq!((state.len(), crc32fast::hash(state)), (0, 0));
    }
}
