//! A loop closure: two keyframes that may show one place, what was measured between them, and its
//! status.

use crate::index::KeyframeIdx;
use crate::place_recognition::CandidateOrigin;
use crate::pose_graph::{Edge, Prior};
use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_persist::{persist, persist_enum};

/// Whether a loop closure is in the graph, or why not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum LoopStatus {
    /// In the graph.
    Accepted,
    /// As good, and the graph knew as much: it costs no edge.
    Confirmed,
    /// Good by itself, but the estimate is too uncertain to believe one loop alone and no other
    /// has agreed.
    Unconfirmed,
    /// Was in the graph; later loops proved it wrong.
    Withdrawn,
    /// Odometry cannot have drifted this far.
    AgainstOdometry,
    /// The registration found no pose.
    #[default]
    Unregistered,
    /// Too much of one is not found in the other.
    Unlike,
    /// The mixtures diverge.
    Divergent,
    /// Along a bare wall the position is free.
    Degenerate,
    /// Another pose that the estimate leaves open fits nearly as well.
    Ambiguous,
}

persist_enum!(LoopStatus {
    Accepted,
    Confirmed,
    Unconfirmed,
    Withdrawn,
    AgainstOdometry,
    Unregistered,
    Unlike,
    Divergent,
    Degenerate,
    Ambiguous,
});

impl LoopStatus {
    /// Whether the keyframes show one place: in the graph, or known to it without.
    pub fn is_loop(self) -> bool {
        matches!(self, Self::Accepted | Self::Confirmed)
    }

    /// Its name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Confirmed => "confirmed",
            Self::Unconfirmed => "unconfirmed",
            Self::Withdrawn => "withdrawn",
            Self::AgainstOdometry => "against_odometry",
            Self::Unregistered => "unregistered",
            Self::Unlike => "unlike",
            Self::Divergent => "divergent",
            Self::Degenerate => "degenerate",
            Self::Ambiguous => "ambiguous",
        }
    }
}

/// What a closure was judged by; `None` for what was not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scores {
    /// Share of the newer keyframe's surroundings that the older one's explain.
    pub forward: Option<f64>,
    /// The other way round.
    pub backward: Option<f64>,
    /// The best fit of another pose that the estimate leaves open: the opposite heading, or
    /// elsewhere along its least certain direction.
    pub rival: Option<f64>,
    /// Largest share explained of the newer surroundings where they are moved along their least
    /// certain direction.
    pub displaced: Option<f64>,
    /// Cauchy-Schwarz divergence.
    pub divergence: Option<f64>,
    /// Standard deviation of the position along its least certain direction, m, where scans of both
    /// keyframes' surroundings saw every direction: else what the least squares say is the grid's.
    pub sigma_m: Option<f64>,
    /// Squared deviation from the estimate, weighed by both covariances (3 degrees of freedom).
    pub chi2: Option<f64>,
    /// Standard deviation of the estimate's position along its least certain direction, m.
    pub prior_sigma_m: Option<f64>,
}
persist!(Scores {
    forward,
    backward,
    rival,
    displaced,
    divergence,
    sigma_m,
    chi2,
    prior_sigma_m,
});

impl Scores {
    /// The smaller share: both must agree.
    pub fn fit(&self) -> f64 {
        let shares = self.forward.zip(self.backward);
        shares.map_or(0.0, |(a, b)| a.min(b))
    }
}

/// Two keyframes that may show one place, registered and judged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoopClosure {
    /// The older keyframe: the root of the submap.
    pub older: KeyframeIdx,
    /// The newer keyframe.
    pub newer: KeyframeIdx,
    /// Why it was registered.
    pub origin: CandidateOrigin,
    /// Pose of the newer keyframe in the frame of the older one.
    pub older_from_newer: Pose2,
    /// Information of that pose, in the newer keyframe's frame; 1/m^2, 1/(m rad), 1/rad^2.
    pub information: Matrix3<f64>,
    /// What it was judged by.
    pub scores: Scores,
    /// Whether it is in the graph, or why not.
    pub status: LoopStatus,
}

persist!(LoopClosure {
    older,
    newer,
    origin,
    older_from_newer,
    information,
    scores,
    status
});

impl LoopClosure {
    /// Holds it against the estimate.
    pub(super) fn weigh(&mut self, prior: &Prior) {
        let covariance = self.information.try_inverse();
        self.scores.prior_sigma_m = Some(prior.sigma_m());
        self.scores.chi2 = covariance.map(|c| prior.chi2(&self.older_from_newer, &c));
    }

    /// Its edge of the graph.
    pub(crate) fn edge(&self) -> Edge {
        Edge {
            from: self.older,
            to: self.newer,
            measured: self.older_from_newer,
            information: (self.information + self.information.transpose()) * 0.5,
        }
    }
}
