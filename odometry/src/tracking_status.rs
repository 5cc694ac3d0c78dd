//! How far a scan's pose can be believed, and why not further.

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
    /// A scan without a solution: nothing was there to set it against.
    fn default() -> Self {
        Self {
            trust: Trust::Degraded as u32,
            reasons: TrustReason::Unsupported as u32,
            localizability: Localizability::Unknown as u32,
            weak_direction_rad: 0.0,
        }
    }
}

impl TrackingStatus {
    /// How far the pose can be believed.
    pub fn trust(&self) -> Trust {
        Trust::from_code(self.trust)
    }
}
