//! Indices of the mapper's lists as types: none is taken for another.

use randt_persist::{Error, Persist, Reader, Writer};

/// A keyframe of the map and its node of the pose graph, in the order in which they came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct KeyframeIdx(pub usize);

/// A connected component of the pose graph, by the index of its first keyframe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ComponentIdx(pub usize);

/// A loop closure in the list of all that were registered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ClosureIdx(pub usize);

impl ComponentIdx {
    /// The keyframe whose pose the component keeps.
    pub fn first_keyframe(self) -> KeyframeIdx {
        KeyframeIdx(self.0)
    }
}

/// Indices are saved as `usize` is.
macro_rules! saved_as_usize {
    ($($index:ident),+) => { $(
        impl Persist for $index {
            fn save(&self, out: &mut Writer<'_>) {
                self.0.save(out);
            }

            fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
                self.0.restore(from)
            }
        }
    )+ };
}
saved_as_usize!(KeyframeIdx, ClosureIdx);
