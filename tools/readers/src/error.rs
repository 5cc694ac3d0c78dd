//! Why an input cannot be read.

/// Why an input cannot be read; every text names file, offset, value and what would be right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system's word on a file.
    #[error("{path}: {source}")]
    Io {
        /// File or folder.
        path: String,
        /// Its word.
        source: std::io::Error,
    },
}
