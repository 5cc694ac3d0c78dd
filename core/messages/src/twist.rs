//! `robot/twist`: how fast the robot moves by its wheels, or by anything else that measures that.

use crate::{Header, plain};

plain! {
    /// One measurement of the robot's velocity in `base_link`.
    pub struct Twist {
        /// `stamp_ns` is the instant of the velocity.
        pub header: Header,
        /// When it reached the host, ns.
        pub arrival_ns: i64,
        /// Forward m/s, left m/s, yaw rate rad/s.
        pub velocity: [f64; 3],
        /// Covariance of these, row by row; a variance of 0 is unknown.
        pub covariance: [f64; 9],
    }
}
