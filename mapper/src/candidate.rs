//! A loop candidate: two places that may be one, what was measured between them, and what became of it.

use crate::{graph::Edge, plain, search::Source};
use nalgebra::Matrix3;
use randt_geometry::Pose2;
use serde::{Deserialize, Serialize};

/// What became of a candidate, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Fate {
    /// In the graph.
    Accepted,
    /// Good by itself, but the estimate is too uncertain to believe one loop alone and no other has agreed.
    Unconfirmed,
    /// Was in the graph; later loops proved it wrong.
    Withdrawn,
    /// Odometry cannot have drifted so far.
    AgainstOdometry,
    /// The registration ended nowhere.
    Unregistered,
    /// Too much of one is not found in the other.
    Unlike,
    /// The mixtures diverge.
    Divergent,
    /// Along a bare wall the position is free.
    Degenerate,
    /// The opposite heading fits nearly as well.
    Ambiguous,
}

impl Fate {
    /// Its name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
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

/// What a candidate was judged by; `None` where it did not come so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Share of the newer place's surroundings that the older one's explain.
    pub forward: Option<f64>,
    /// The other way round.
    pub backward: Option<f64>,
    /// The better-fitting share under the opposite heading, where that was possible.
    pub flipped: Option<f64>,
    /// Largest share explained of the newer surroundings where they are moved along their least certain direction.
    pub displaced: Option<f64>,
    /// Cauchy-Schwarz divergence.
    pub divergence: Option<f64>,
    /// Standard deviation of the position along its least certain direction, m.
    pub sigma_m: Option<f64>,
    /// Squared deviation from the estimate, weighed by both covariances (3 degrees of freedom).
    pub chi2: Option<f64>,
    /// Standard deviation of the estimate's position along its least certain direction, m.
    pub prior_sigma_m: Option<f64>,
}

/// Two places that may be one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Index of the older place: the root of the submap.
    pub from: usize,
    /// Index of the newer place.
    pub to: usize,
    /// Why it was looked at.
    pub source: Source,
    /// Pose of the newer place in the frame of the older one.
    #[serde(with = "plain::pose")]
    pub relative: Pose2,
    /// Information of that pose, in the newer place's frame.
    #[serde(with = "plain::matrix")]
    pub information: Matrix3<f64>,
    /// What it was judged by.
    pub scores: Scores,
    /// What became of it.
    pub fate: Fate,
}

impl Candidate {
    /// What it says to the graph.
    pub(crate) fn edge(&self) -> Edge {
        Edge {
            from: self.from,
            to: self.to,
            measured: self.relative,
            information: (self.information + self.information.transpose()) * 0.5,
        }
    }
}
