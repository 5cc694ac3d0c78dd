//! What a snapshot has of the graph; constraints of odometry follow from the keyframes.

use super::{Attachment, Edge, Loop, LoopId};
use crate::index::{ClosureIdx, KeyframeIdx};
use crate::verification::LoopClosure;
use nalgebra::Matrix3;
use randt_geometry::{Pose2, elementary::PI};
use randt_persist::{Error, Persist, Reader, Writer, persist};

/// The estimate and the loops.
#[derive(Debug, Default)]
pub(crate) struct SavedGraph {
    pub poses: Vec<SavedPose>,
    pub loops: Vec<SavedLoop>,
    /// The marginalized nodes, rising.
    pub attached: Vec<SavedAttachment>,
    /// What leads over them.
    pub bridges: Vec<SavedEdge>,
    pub next_loop: u64,
    pub failures: u64,
}
persist!(SavedGraph {
    poses,
    loops,
    attached,
    bridges,
    next_loop,
    failures
});

/// A pose by its three numbers, to the last bit: maps have thousands.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SavedPose(pub Pose2);

impl Persist for SavedPose {
    fn save(&self, out: &mut Writer<'_>) {
        self.0.to_array().save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let mut numbers = [0.0; 3];
        numbers.restore(from)?;
        self.0 = pose_from_saved(numbers);
        Ok(())
    }
}

/// The pose that gives these numbers.
fn pose_from_saved([x_m, y_m, yaw_rad]: [f64; 3]) -> Pose2 {
    let pose = Pose2::new(x_m, y_m, yaw_rad);
    // The last heading before half a turn is only made from one turn less: wrapped again it rounds
    // to the other end.
    match pose.yaw_rad.to_bits() == yaw_rad.to_bits() {
        true => pose,
        false => Pose2::new(x_m, y_m, yaw_rad - 2.0 * PI),
    }
}

/// A marginalized node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SavedAttachment {
    pub node: KeyframeIdx,
    pub to: KeyframeIdx,
    pub pose: SavedPose,
}
persist!(SavedAttachment { node, to, pose });

/// An edge over marginalized nodes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SavedEdge {
    pub from: KeyframeIdx,
    pub to: KeyframeIdx,
    pub measured: SavedPose,
    pub information: Matrix3<f64>,
}
persist!(SavedEdge {
    from,
    to,
    measured,
    information
});

impl From<&Edge> for SavedEdge {
    fn from(edge: &Edge) -> Self {
        Self {
            from: edge.from,
            to: edge.to,
            measured: SavedPose(edge.measured),
            information: edge.information,
        }
    }
}

impl From<SavedEdge> for Edge {
    fn from(saved: SavedEdge) -> Self {
        Self {
            from: saved.from,
            to: saved.to,
            measured: saved.measured.0,
            information: saved.information,
        }
    }
}

impl SavedGraph {
    /// For every node where it stands; `None` where one is not there.
    pub fn attachments(&self) -> Option<Vec<Option<Attachment>>> {
        let mut attachments = vec![None; self.poses.len()];
        for SavedAttachment { node, to, pose } in &self.attached {
            let pose = pose.0;
            *attachments.get_mut(node.0)? = Some(Attachment { to: *to, pose });
        }
        Some(attachments)
    }
}

/// A loop of the graph without its edge, which its closure has.
#[derive(Debug, Default)]
pub(crate) struct SavedLoop {
    pub id: u64,
    pub closure: ClosureIdx,
    pub on: bool,
    /// chi2 and weight where they do not follow from the poses: after an optimisation without a
    /// result.
    pub odd: Option<(f64, f64)>,
}
persist!(SavedLoop {
    id,
    closure,
    on,
    odd
});

impl SavedLoop {
    /// What is saved of a loop in an estimate.
    pub fn new(found: &Loop, closure: ClosureIdx, poses: &[Pose2]) -> Self {
        let bits = |l: &Loop| (l.chi2.to_bits(), l.weight.to_bits());
        let is_odd = bits(&found.weighed(poses)) != bits(found);
        Self {
            id: found.id.0,
            closure,
            on: found.on,
            odd: is_odd.then_some((found.chi2, found.weight)),
        }
    }

    /// The loop as it was; `None` where its closure or their keyframes are not there.
    pub fn restored(&self, closures: &[LoopClosure], poses: &[Pose2]) -> Option<Loop> {
        let found = Loop {
            id: LoopId(self.id),
            edge: closures.get(self.closure.0)?.edge(),
            chi2: 0.0,
            weight: 1.0,
            on: self.on,
        };
        if found.edge.from.max(found.edge.to).0 >= poses.len() {
            return None;
        }
        Some(match self.odd {
            Some((chi2, weight)) => Loop {
                chi2,
                weight,
                ..found
            },
            None => found.weighed(poses),
        })
    }
}

/// The constraints of odometry that marginalized keyframes leave: bridges stand where the steps
/// did that they lead over. `None` where one is missing.
pub(super) fn bridged(
    odometry: Vec<Edge>,
    attachments: &[Option<Attachment>],
    bridges: impl Iterator<Item = Edge>,
) -> Option<Vec<Edge>> {
    let is_gone = |node: KeyframeIdx| attachments.get(node.0).is_some_and(Option::is_some);
    let mut bridges = bridges.peekable();
    let mut left = Vec::with_capacity(odometry.len());
    for edge in odometry {
        match (is_gone(edge.from), is_gone(edge.to)) {
            (false, false) => left.push(edge),
            (true, false) if edge.from.0 + 1 == edge.to.0 => {
                left.push(bridges.next_if(|bridge| bridge.to == edge.to)?);
            }
            _ => {}
        }
    }
    bridges.next().is_none().then_some(left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn comes_back(pose: Pose2) {
        let again = pose_from_saved(pose.to_array());
        let bits = |pose: Pose2| {
            let (cos, sin) = pose.cos_sin();
            [pose.x_m, pose.y_m, pose.yaw_rad, cos, sin].map(f64::to_bits)
        };
        assert_eq!(bits(again), bits(pose), "{pose:?}");
    }

    proptest! {
        #[test]
        fn poses_come_back(x: f64, y: f64, yaw in -20.0..20.0_f64, steps in -64..64_i64) {
            comes_back(Pose2::new(x, y, yaw));
            // Around the cut of the angle, bit by bit.
            for end in [PI, -PI, 3.0 * PI, -3.0 * PI, 0.0] {
                let bits = end.to_bits().wrapping_add(steps as u64);
                comes_back(Pose2::new(x, y, f64::from_bits(bits)));
            }
        }
    }
}
