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
/// which a test notices. The build does not matter: another one's map is a map. Raise it seldom:
/// pushing thousands of keyframes anew takes minutes in which a robot that was updated has no map.
/// Forms 1 and 2 had no magic.
const FORM: [u8; 16] = *b"mapper snapshot4";

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

    /// Adds its increment to what the snapshots before it have; `None` where something between is
    /// missing.
    pub fn add_to(&mut self, grown: &mut Grown) -> Option<()> {
        let mut increment = Increment::default();
        increment.restore(&mut self.rest).ok()?;
        let known = increment.known;
        if known.closures > grown.closures.len() || known.keys > grown.keys.len() {
            return None;
        }
        grown.closures.truncate(known.closures);
        grown.closures.extend(increment.closures);
        grown.keys.truncate(known.keys);
        grown.keys.extend(increment.keys);
        Some(())
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
            keys: self.recognition.keys.len(),
        }
    }

    /// Appends what [`Mapper::restore`] needs beside the keyframes and what the snapshots before
    /// it have.
    pub(crate) fn snapshot(&self, known: Known, out: &mut Vec<u8>) {
        let (closures, keys) = (self.closures(), &self.recognition.keys);
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
            self.known_ground.save(out);
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
    use crate::index::{ClosureIdx, KeyframeIdx};
    use crate::place_recognition::CandidateOrigin;
    use crate::verification::Scores;
    use nalgebra::Matrix3;
    use randt_config::Config;
    use randt_geometry::Pose2;
    use randt_messages::{Keyframe, Message};
    use randt_persist::variant_code;

    /// The bytes of a snapshot, written by hand.
    #[derive(Default)]
    struct Expected(Vec<u8>);

    impl Expected {
        fn whole(&mut self, numbers: &[u64]) {
            self.0.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        }

        fn real(&mut self, numbers: &[f64]) {
            self.0.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        }

        fn variant(&mut self, name: &str) {
            self.0.extend(variant_code(name).to_le_bytes());
        }

        fn options(&mut self, values: &[Option<f64>]) {
            for value in values {
                self.0.push(u8::from(value.is_some()));
                self.real(value.as_slice());
            }
        }
    }

    /// A change of what is saved raises the number in `FORM` and is written here: an older
    /// snapshot would else be read as something that it is not.
    #[test]
    fn form_four_is_as_it_was() {
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
        mapper.verification.closures = vec![closure, closure];
        let added = mapper.graph.add_closure(ClosureIdx(1), closure.edge());
        assert!(added.is_ok());
        // The one between stands on the first from now on.
        let dropped = mapper.graph.marginalize(KeyframeIdx(1), KeyframeIdx(0));
        assert_eq!(dropped, Some(Vec::new()));
        let known = Known {
            closures: 1,
            keys: 2,
        };
        let mut bytes = Vec::new();
        mapper.snapshot(known, &mut bytes);
        assert!(Opened::new(mapper.fingerprint, &bytes).is_ok());

        let mut expected = Expected::default();
        // Keyframes taken, then the increment: what was known, closures, keys.
        expected.whole(&[3, 1, 2, 1]);
        expected.whole(&[0, 2]);
        expected.variant("Appearance");
        expected.real(&[0.25, 1.5]);
        let (cos, sin) = closure.older_from_newer.cos_sin();
        expected.real(&[1.0, 2.0, 0.5, cos, sin]);
        expected.real(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let scores = [Some(0.5), None, None, None, None, None, Some(2.0), None];
        expected.options(&scores);
        expected.variant("Withdrawn");
        let rings = u64::from(Config::default().loops.rings);
        expected.whole(&[1, rings]);
        expected.0.extend(vec![0; 4 * rings as usize]);
        // Keyframes: runs of numbers, stamp of the newest, those left out.
        expected.whole(&[2, 0, 2, 300, 1, 1_700_000_000_000_000_300, 0]);
        expected.whole(&[2]);
        expected.variant("Withdrawn");
        expected.variant("Withdrawn");
        // The graph: poses, loops, marginalized nodes and bridges, the next name, failures.
        expected.whole(&[3]);
        let poses = mapper.poses().iter();
        poses.for_each(|pose| expected.real(&pose.to_array()));
        expected.whole(&[1, 0, 1]);
        let found = &mapper.graph_loops()[0];
        // On, with the weight that it has before an optimisation.
        expected.0.extend([1, 1]);
        expected.real(&[found.chi2, 1.0]);
        expected.whole(&[1, 1, 0]);
        expected.real(&mapper.poses()[0].between(&mapper.poses()[1]).to_array());
        expected.whole(&[1, 0, 2]);
        let bridge = &mapper.graph.odometry()[0];
        expected.real(&bridge.measured.to_array());
        expected.real(bridge.information.as_slice());
        expected.whole(&[1, 0]);
        // Path at the last search, no merge tried, known ground, version.
        expected.real(&[mapper.path_m(), f64::NEG_INFINITY]);
        // The first two lie far enough behind the last one, and no loop holds them.
        expected.whole(&[2, 0]);
        expected.whole(&[3]);
        // Behind the envelope, which has the configuration in it.
        assert_eq!(&bytes[48..], expected.0);
    }
}
