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
        "{path}: {found}; expected a folder of polar images (Oxford, Boreas, MulRan, RADIATE), a ROS 1 bag, a ROS 2 bag (MCAP or db3) or a randt log"
    )]
    NotRecognised {
        /// File or folder.
        path: String,
        /// What is there instead.
        found: String,
    },
    /// There is no radar in it.
    #[error(
        "{path}: no radar topic (sensor_msgs/PointCloud2, Image or LaserScan, or Navtech's RadarFftDataMessage) to take by itself or by --radar-topic; it holds {topics}"
    )]
    NoRadar {
        /// File.
        path: String,
        /// The topics that are there, with their types.
        topics: String,
    },
    /// The topic asked for is not in it, or has another type.
    #[error("{path}: no topic {topic} of type {wanted} ({option}); it holds {topics}")]
    NoTopic {
        /// File.
        path: String,
        /// What was asked for.
        topic: String,
        /// The type that it should have.
        wanted: &'static str,
        /// The option that names it.
        option: &'static str,
        /// The topics that are there, with their types.
        topics: String,
    },
    /// No message of the radar's topic can be decoded.
    #[error(
        "{path}: no radar topic that can be decoded; {topic}: {why}; --radar-topic or --intensity-field may help; it holds {topics}"
    )]
    NotDecoded {
        /// File.
        path: String,
        /// The radar's topic.
        topic: String,
        /// What is wrong with its first message.
        why: String,
        /// The topics that are there, with their types.
        topics: String,
    },
    /// A polar image does not say how large its range bins are (a mistake in the configuration).
    #[error("{path}: {bins} bins are not a CTS350-X's 3768: say sensor.range_resolution_m (--set)")]
    BinSize {
        /// The image or topic.
        path: String,
        /// Bins of a beam.
        bins: usize,
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
