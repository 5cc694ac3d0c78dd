//! How far a scan's pose can be believed, and why not further.

use crate::localizability::CELLS_MIN;
use randt_messages::{Localizability, Trust, TrustReason};
use randt_persist::persist;

/// What was judged of a scan when it was the newest one, in the codes of the messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingStatus {
    /// A [`Trust`].
    pub trust: u32,
    /// A set of [`TrustReason`]: empty where trust is good, and only there.
    pub reasons: u32,
    /// A [`Localizability`].
    pub localizability: u32,
    /// The direction that is not seen, in the robot's frame, rad.
    pub weak_direction_rad: f64,
}

persist!(TrackingStatus {
    trust,
    reasons,
    localizability,
    weak_direction_rad
});

impl Default for TrackingStatus {
    fn default() -> Self {
        Self::without_solution(0)
    }
}

impl TrackingStatus {
    /// Of a scan of that many cells that could not be set against a submap: by itself it sees
    /// nothing where it has too few of them.
    pub fn without_solution(cells: usize) -> Self {
        let localizability = if cells < CELLS_MIN {
            Localizability::None
        } else {
            Localizability::Unknown
        };
        Self {
            trust: Trust::Degraded as u32,
            reasons: TrustReason::Unsupported as u32,
            localizability: localizability as u32,
            weak_direction_rad: 0.0,
        }
    }

    /// How far the pose can be believed.
    pub fn trust(&self) -> Trust {
        Trust::from_code(self.trust)
    }
}
