//! Typed configuration: an environment profile, a sensor, a robot; overrides on top.
//!
//! Responsible for reading, checking and showing. Not responsible for where a value is used.

mod error;
mod section;
mod sections;

pub use error::Error;
pub use section::Key;
pub use sections::{Attitude, Filter, Keyframe, Ndt, Odometry, Robot, Sensor, Submap};

/// All that is in force.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Beam-wise filter.
    pub filter: Filter,
    /// Attitude filter.
    pub attitude: Attitude,
    /// Cells.
    pub ndt: Ndt,
    /// Motion estimation.
    pub odometry: Odometry,
    /// Keyframes.
    pub keyframe: Keyframe,
    /// Submaps.
    pub submap: Submap,
    /// The radar.
    pub sensor: Sensor,
    /// Mounting.
    pub robot: Robot,
}
