//! Why a configuration is refused.

/// Why a configuration is refused (exit code 78).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system's word on a file.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// Its word.
        source: std::io::Error,
    },
}
