//! What every kind of input gives.

use crate::Event;
use randt_geometry::{Pose2, Quaternion};
use randt_messages::SensorKind;

/// Where the sensors sit on the robot, as far as the input has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extrinsics {
    /// Radar in `base_link`.
    pub radar: Option<Pose2>,
    /// IMU in `base_link` (orientation only).
    pub imu: Option<Quaternion>,
}

impl From<randt_log::Robot> for Extrinsics {
    fn from(robot: randt_log::Robot) -> Self {
        Self {
            radar: robot.radar.map(Pose2::from_array),
            imu: robot.imu.map(|[w, x, y, z]| Quaternion::new(w, x, y, z)),
        }
    }
}

/// Something that was dropped, repaired or assumed, with how often.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counter {
    /// Short name, `snake_case`.
    pub name: &'static str,
    /// How often.
    pub count: u64,
    /// The first case: file, offset, value, what would be right.
    pub first: String,
    /// Whether data were lost by it (exit code 3), or only repaired or assumed.
    pub loss: bool,
}

/// An input's description of itself.
#[derive(Clone, Debug)]
pub struct InputInfo {
    /// Kind, such as `oxford`, `ros1-bag`, `ros2-mcap`, `ros2-db3`, `randt-log`.
    pub format: &'static str,
    /// The radar.
    pub sensor: SensorKind,
    /// Number of sweeps where it is known beforehand (for the progress bar).
    pub scans: Option<u64>,
    /// Mounting.
    pub extrinsics: Extrinsics,
    /// The configuration that a live run was recorded with, as TOML.
    pub configuration: Option<String>,
    /// Range bins of polar images.
    pub bin_size: Option<BinSize>,
    /// The fields that the returns have, where none of them is an intensity.
    pub without_intensity: Option<String>,
    /// What is in it.
    pub topics: Vec<InputTopic>,
}

/// A topic of an input, or a file that stands for one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputTopic {
    /// Name.
    pub name: String,
    /// Type of its messages.
    pub type_name: String,
    /// Number of its messages.
    pub messages: u64,
    /// As what it is used: `radar`, `imu`, `twist`, `mounting`; `None` where it is not.
    pub used_as: Option<&'static str>,
}

/// Range bins of polar images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinSize {
    /// Bins of a beam.
    pub bins: usize,
    /// Width of a bin, m; `None` where neither the input nor the number of bins tells it.
    pub size_m: Option<f64>,
}

/// A log that is read from its beginning to its end.
///
/// Events come in order of their stamps as far as the log has them so; a step back is the log's
/// own, and odometry judges it.
pub trait Source {
    /// The input's description of itself.
    fn info(&self) -> &InputInfo;

    /// Sets the width of a polar image's range bins, m; before the first event.
    fn set_bin_size(&mut self, _size_m: f64) {}

    /// The next event, `None` at the end.
    ///
    /// Damage inside the input is counted and stepped over; an error ends the reading.
    fn next_event(&mut self) -> Result<Option<Event>, crate::Error>;

    /// What was dropped, repaired or assumed so far.
    fn counters(&self) -> Vec<Counter>;
}
