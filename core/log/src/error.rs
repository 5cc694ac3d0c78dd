//! Why a log cannot be written or read.

/// Why a log cannot be written or read. Every text names the file and includes the cause, so there
/// is no `source`, which would print the cause twice.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system's error on a file.
    #[error("{path}: {cause}")]
    Io {
        /// The file.
        path: String,
        /// The error.
        cause: std::io::Error,
    },
    /// The container could not be written.
    #[error("{path}: cannot write the log: {cause}")]
    Write {
        /// The file.
        path: String,
        /// What went wrong.
        cause: Box<mcap::McapError>,
    },
    /// The first bytes are not MCAP's.
    #[error(
        "{path}: offset 0: not an MCAP file: it begins with {found:02x?}, MCAP with [89, 4d, 43, 41, 50, 30, 0d, 0a]"
    )]
    NotMcap {
        /// The file.
        path: String,
        /// Its first bytes.
        found: Vec<u8>,
    },
    /// A topic's messages have another layout than in this program, and the log does not describe
    /// it.
    #[error(
        "{path}: topic {topic} holds {found}, this program reads {expected}: the log was written by another build ({written_by}); read it with that one"
    )]
    Layout {
        /// The file.
        path: String,
        /// The topic.
        topic: String,
        /// Type name in the log.
        found: String,
        /// Type name here.
        expected: &'static str,
        /// The program that wrote it, as the log names it.
        written_by: String,
    },
    /// A message's size does not fit its type.
    #[error(
        "{path}: offset {offset}: message {sequence} of topic {topic} has {found} bytes, a {expected} has {head} and a multiple of {item}"
    )]
    MessageSize {
        /// The file.
        path: String,
        /// Where the record or chunk that holds the message begins.
        offset: u64,
        /// Its sequence number.
        sequence: u32,
        /// Its topic.
        topic: String,
        /// Its bytes.
        found: usize,
        /// Its type.
        expected: &'static str,
        /// Bytes of the fixed part.
        head: usize,
        /// Bytes of one item.
        item: usize,
    },
    /// A metadata record has another value than this program expects.
    #[error("{path}: metadata {record}: {key} = {value:?}: expected {expected}")]
    Metadata {
        /// The file.
        path: String,
        /// Name of the record.
        record: &'static str,
        /// Key in it.
        key: &'static str,
        /// Its value.
        value: String,
        /// What is accepted.
        expected: &'static str,
    },
}

impl Error {
    /// An error of the operating system at a path.
    pub(crate) fn io(path: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::Io { path, cause }
    }
}
