//! Why a trajectory cannot be read or compared.

/// Why a trajectory cannot be read or compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An error of the operating system.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// The error.
        source: std::io::Error,
    },
    /// A row that is none.
    #[error("{path}:{line}: {problem}")]
    Row {
        /// The file.
        path: String,
        /// The line, from 1.
        line: usize,
        /// The value, and what would be right.
        problem: String,
    },
    /// A file without a pose.
    #[error(
        "{path}: no poses; a trajectory has rows of 8 numbers (TUM: stamp x y z qx qy qz qw) \
         or of 12 (KITTI: a 3 x 4 matrix, row by row)"
    )]
    Empty {
        /// The file.
        path: String,
    },
    /// Two trajectories of which only one has stamps.
    #[error(
        "the {stamped} has stamps (TUM) and the {unstamped} has none (KITTI): \
         poses cannot be matched; give both in one format"
    )]
    MixedFormats {
        /// `estimate` or `truth`.
        stamped: &'static str,
        /// The other one.
        unstamped: &'static str,
    },
    /// Rows without stamps that cannot belong together one by one.
    #[error(
        "the estimate has {estimate} rows and the truth {truth}: rows without stamps (KITTI) \
         are compared one by one, so their numbers must be equal; use TUM rows otherwise"
    )]
    RowCounts {
        /// Rows of the estimate.
        estimate: usize,
        /// Rows of the truth.
        truth: usize,
    },
    /// Loops, which are identified by stamps, of a trajectory without.
    #[error(
        "the {name} has no stamps: loops are judged by stamp, so give TUM rows (stamp x y z qx qy qz qw)"
    )]
    NoStamps {
        /// `estimate` or `truth`.
        name: &'static str,
    },
    /// A drawing that cannot be made.
    #[error("plot: {0}")]
    Plot(String),
}
