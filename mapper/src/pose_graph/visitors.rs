//! Which keyframe passed a node of the graph last.

use crate::index::KeyframeIdx;
use std::collections::BTreeMap;

/// For nodes on which marginalized ones stand the newest of these.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Visitors(BTreeMap<KeyframeIdx, KeyframeIdx>);

impl Visitors {
    /// A keyframe stands on a node from now on.
    pub fn push(&mut self, node: KeyframeIdx, visitor: KeyframeIdx) {
        let newest = self.0.entry(node).or_insert(visitor);
        *newest = visitor.max(*newest);
    }

    /// The newest keyframe that stands on a node; the node itself where none does.
    pub fn newest(&self, node: KeyframeIdx) -> KeyframeIdx {
        self.0.get(&node).copied().unwrap_or(node)
    }
}

/// Of pairs of a node and a keyframe that stands on it.
impl FromIterator<(KeyframeIdx, KeyframeIdx)> for Visitors {
    fn from_iter<I: IntoIterator<Item = (KeyframeIdx, KeyframeIdx)>>(pairs: I) -> Self {
        let mut visitors = Self::default();
        for (node, visitor) in pairs {
            visitors.push(node, visitor);
        }
        visitors
    }
}
