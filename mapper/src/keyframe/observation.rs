//! What a keyframe saw, at hand or as the journal has it.

use crate::journal::{self, Packed};
use randt_messages::{Keyframe, KeyframeBeam, KeyframePoint, Message, MessageRef};
use std::cell::{OnceCell, RefCell};
use std::ops::Deref;

/// Beams and returns of a keyframe, in its own `base_link` at the sweep's end.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// Where the beams began, with the first of each one's returns.
    pub beams: Vec<KeyframeBeam>,
    /// De-skewed returns, by beam, then range.
    pub points: Vec<KeyframePoint>,
}

/// An observation that is unpacked when it is first read: a mapper that comes back has thousands,
/// and unpacking all of them takes longer than all the rest.
#[derive(Clone, Debug)]
pub struct LazyObservation {
    /// A keyframe's record, until it is unpacked.
    packed: RefCell<Option<Packed>>,
    observation: OnceCell<Observation>,
}

/// Empty where the bytes are no keyframe.
impl From<Packed> for LazyObservation {
    fn from(packed: Packed) -> Self {
        Self {
            packed: Some(packed).into(),
            observation: OnceCell::new(),
        }
    }
}

impl From<Observation> for LazyObservation {
    fn from(observation: Observation) -> Self {
        Self {
            packed: RefCell::default(),
            observation: observation.into(),
        }
    }
}

impl Deref for LazyObservation {
    type Target = Observation;

    fn deref(&self) -> &Observation {
        self.observation.get_or_init(|| {
            let mut message = Message::default();
            let packed = self.packed.take();
            match packed.is_some_and(|packed| journal::read_keyframe(&packed, &mut message)) {
                true => Observation::from_message(message.as_ref()),
                false => Observation::default(),
            }
        })
    }
}

impl Observation {
    /// What a message shows.
    pub fn from_message(keyframe: MessageRef<'_, Keyframe>) -> Self {
        let head = keyframe.head;
        let beams = head.beams.get(..head.beam_count as usize);
        Self {
            beams: beams.unwrap_or(&head.beams).to_vec(),
            points: keyframe.items.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_observation_is_what_the_message_showed() {
        let mut message = Message::<Keyframe>::default();
        message.head.beam_count = 1;
        message.head.beams[0].azimuth_rad = 0.5;
        message.items.extend([KeyframePoint {
            x_m: 1.0,
            y_m: 2.0,
            intensity: 9.0,
            beam: 0,
            reserved: 0,
        }]);
        let shown = Observation::from_message(message.as_ref());
        let packed = LazyObservation::from(Packed::from_message(message.as_ref()));
        assert_eq!(
            (&packed.beams, &packed.points),
            (&shown.beams, &shown.points)
        );
        assert!(packed.packed.borrow().is_none(), "kept twice");
        let nonsense = Packed::from(b"nonsense".to_vec());
        assert!(LazyObservation::from(nonsense).points.is_empty());
    }
}
