//! `truth/pose`: where a simulated robot really was. Evaluation reads it; the estimator never
//! does.

use crate::{Header, plain};

plain! {
    /// True pose and velocity of `base_link` at the stamp.
    pub struct TruthPose {
        /// Stamp: the instant of the pose.
        pub header: Header,
        /// x m, y m, yaw rad in the world.
        pub pose: [f64; 3],
        /// Forward m/s, left m/s, yaw rate rad/s.
        pub velocity: [f64; 3],
    }
}
