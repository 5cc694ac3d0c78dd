//! What can go wrong with an emulator.

use std::path::PathBuf;

/// An emulator cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] randt_log::Error),
    /// The log has nothing that this emulator could send.
    #[error("{}: no {what} in it", path.display())]
    Empty {
        /// The log.
        path: PathBuf,
        /// What is missing.
        what: &'static str,
    },
    /// A link is wanted where something else is.
    #[error("{}: there is something that is no link; it is left alone", .0.display())]
    Taken(PathBuf),
    /// A fault that this protocol cannot have.
    #[error("{protocol} cannot have the fault {fault}; it can have {can}")]
    Fault {
        /// The protocol.
        protocol: &'static str,
        /// What was asked for.
        fault: &'static str,
        /// What there is.
        can: String,
    },
    /// A socket or terminal cannot be opened.
    #[error("{what}: {source}")]
    Io {
        /// What was to be opened.
        what: String,
        /// Why it was not.
        source: std::io::Error,
    },
}

impl Error {
    /// Names what was to be opened.
    pub fn io(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let what = what.into();
        move |source| Self::Io { what, source }
    }
}
