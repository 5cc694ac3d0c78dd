//! Why an input cannot be read.

use std::path::Path;

/// Why an input cannot be read; every text names file, offset, value and what would be right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of the operating system.
    #[error("{path}: {source}")]
    Io {
        /// File or folder.
        path: String,
        /// The error.
        source: std::io::Error,
    },
    /// The content is none that this crate reads.
    #[error(
        "{path}: {found}; expected an Oxford Radar RobotCar folder, a ROS 1 bag, a ROS 2 bag (MCAP or db3) or a randt log"
    )]
    NotRecognised {
        /// File or folder.
        path: String,
        /// What is there instead.
        found: String,
    },
    /// There is no radar in it.
    #[error("{path}: no radar topic (sensor_msgs/PointCloud2); it holds {topics}")]
    NoRadar {
        /// File.
        path: String,
        /// The topics that are there, with their types.
        topics: String,
    },
    /// The topic asked for is not in it, or has another type.
    #[error("{path}: no topic {topic} of type {wanted}; it holds {topics}")]
    NoTopic {
        /// File.
        path: String,
        /// What was asked for.
        topic: String,
        /// The type that it should have.
        wanted: &'static str,
        /// The topics that are there, with their types.
        topics: String,
    },
    /// The file as a whole is broken.
    #[error("{path}: at byte {offset}: {what}")]
    Broken {
        /// File.
        path: String,
        /// Where.
        offset: u64,
        /// What is wrong and what would be right.
        what: String,
    },
    /// A line of a text file is broken.
    #[error("{path}: line {line}: {what}")]
    Line {
        /// File.
        path: String,
        /// Which, from 1.
        line: usize,
        /// What is wrong and what would be right.
        what: String,
    },
    /// An MCAP file that cannot be read.
    #[error(transparent)]
    Log(#[from] randt_log::Error),
}

impl Error {
    /// For `map_err`: an I/O error with its file.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Io {
            path: path.display().to_string(),
            source,
        }
    }
}
