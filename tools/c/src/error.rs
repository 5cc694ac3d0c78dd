//! Why the bus cannot be read.

/// Errors of the library.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The process shell's.
    #[error(transparent)]
    Stage(#[from] randt_stage::Error),
    /// No stage lives there.
    #[error("{0}: no stage lives there; `randt top` shows what runs")]
    NoPipeline(String),
    /// A topic that no stage has opened.
    #[error("{0}: no stage has opened it; `randt top` shows what runs")]
    NobodyHas(String),
    /// The caller was compiled with the header of another build.
    #[error(
        "{topic}: this library has the layout {ours}, the program {theirs}: print the header anew with `randt layout --c`, and compile anew"
    )]
    Header {
        /// The topic's name.
        topic: &'static str,
        /// This build's.
        ours: &'static str,
        /// The header's.
        theirs: String,
    },
    /// A pointer that must not be null, or a text that is not UTF-8.
    #[error("{0}: null, or no UTF-8")]
    Argument(&'static str),
}
