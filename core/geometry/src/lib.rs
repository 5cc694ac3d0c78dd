//! Plane and attitude geometry with the same bits on every machine. No I/O, no clock.
//!
//! ```
//! use randt_geometry::Pose2;
//! let step = Pose2::exp([0.2, 0.0, -0.1].into());
//! let there_and_back = step.compose(&step.inverse());
//! assert!(there_and_back.log().norm() < 1e-15);
//! ```

pub mod elementary;
mod marginal;
mod pose2;
mod quaternion;
mod rotation;

pub use marginal::marginalize_yaw;
pub use pose2::Pose2;
pub use quaternion::Quaternion;
pub use rotation::Rotation;
