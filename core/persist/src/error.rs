//! Why a state cannot be saved or taken over.

/// What is wrong with a saved state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The buffer is too small.
    #[error("the state needs {needed} bytes, there is room for {room}")]
    Room {
        /// Bytes of the state.
        needed: usize,
        /// Bytes of the buffer.
        room: usize,
    },
    /// It does not begin with the magic of such a state.
    #[error("this is not a saved state of this kind: it begins with {0:?}")]
    Foreign(String),
    /// It is shorter or longer than its head says.
    #[error("the saved state has {found} bytes and should have {expected}")]
    Length {
        /// Bytes that were found.
        found: usize,
        /// Bytes that should be.
        expected: u64,
    },
    /// Its checksum does not fit.
    #[error("the saved state is damaged: its checksum is {found:08x} and should be {expected:08x}")]
    Checksum {
        /// Of the bytes that were found.
        found: u32,
        /// As it was saved.
        expected: u32,
    },
    /// Another build has saved it.
    #[error("the state was saved by a build of other source ({saved}; this one is {own})")]
    OtherCode {
        /// Fingerprint of the source that saved it.
        saved: String,
        /// Our own.
        own: String,
    },
    /// It was saved under another configuration.
    #[error(
        "the state was saved under another configuration ({saved:016x}; in force is {own:016x})"
    )]
    OtherConfig {
        /// Fingerprint of that configuration.
        saved: u64,
        /// Of the one in force.
        own: u64,
    },
    /// It ends in the middle of a value, or goes on after the last.
    #[error("the saved state has other values than were asked for")]
    Shape,
    /// A value that is impossible.
    #[error("the saved state holds impossible values of {0}")]
    Unsound(&'static str),
}
