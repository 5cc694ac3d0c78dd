//! A loop of the graph.

use super::super::Edge;
use super::super::loss::Loss;
use randt_geometry::Pose2;

/// chi2 from which a loop is doubted: of three degrees of freedom, 1 in 10,000 is beyond. Below it
/// a loop has its full weight, so that good loops give the plain least squares.
pub(super) const LOOP_PHI: f64 = 21.1;
pub(super) const LOOP_LOSS: Loss = Loss::Scaled { phi: LOOP_PHI };

/// The name of a loop, never given again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LoopId(pub u64);

/// A loop, with its error and weight after the last optimisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    /// Its name.
    pub id: LoopId,
    /// The measurement.
    pub edge: Edge,
    /// e^T Omega e at the estimate, without the weight.
    pub chi2: f64,
    /// 1: believed in full; 0: switched off.
    pub weight: f64,
    /// Whether it counts; [`super::PoseGraph::recheck`] decides.
    pub on: bool,
}

impl Loop {
    /// The same loop as an optimisation that ended at these poses leaves it.
    pub(crate) fn weighed(&self, poses: &[Pose2]) -> Self {
        let mut weighed = self.clone();
        weighed.weigh(poses, LOOP_LOSS);
        weighed
    }

    pub(super) fn weigh(&mut self, poses: &[Pose2], loss: Loss) {
        self.chi2 = self.edge.chi2(poses);
        self.weight = if self.on { loss.weight(self.chi2) } else { 0.0 };
    }
}
