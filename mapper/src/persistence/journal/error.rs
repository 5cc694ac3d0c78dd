//! Why a journal cannot be read or written.

use std::path::PathBuf;

/// Why a journal cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The header is not whole.
    #[error("{0} bytes: a journal's header is longer")]
    HeaderCut(usize),
    /// The first bytes are not a journal's.
    #[error("offset 0: not a mapper's journal: it begins with {0:02x?}, a journal with RANDTMAP")]
    NotAJournal([u8; 8]),
    /// The header's checksum does not fit.
    #[error("the header is damaged")]
    HeaderDamaged,
    /// Written by a program that packs in another way.
    #[error("format version {found}: this program reads {expected}")]
    Version {
        /// In the file.
        found: u32,
        /// Here.
        expected: u32,
    },
    /// Keyframes have another layout than in this program.
    #[error(
        "its keyframes are {found}, this program's are {expected}: another build has written it"
    )]
    Layout {
        /// Type name in the file.
        found: String,
        /// Type name here.
        expected: &'static str,
    },
    /// What is wrong with a file that is none of a mapper's.
    #[error("{}: {cause}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What its bytes show.
        cause: Box<Error>,
    },
    /// The operating system's error on a file.
    #[error("{}: {action}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was to be done.
        action: &'static str,
        /// What it reports.
        cause: std::io::Error,
    },
    /// Another mapper writes there: the lock's file.
    #[error("{}: another process has this journal open", .0.display())]
    Locked(PathBuf),
    /// What is on the disk is no longer known; only reading the file again shows it.
    #[error("{}: a write or sync has failed before: open the journal anew", .0.display())]
    Unsure(PathBuf),
    /// A record is too large to be written.
    #[error("a record of this size is never read back: it is not written")]
    TooLarge,
}
