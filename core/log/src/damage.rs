//! What a reader finds that is not as it was written.

/// A kind of damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DamageKind {
    /// A chunk whose checksum, compression or records are broken; its messages are lost.
    Chunk,
    /// A record outside chunks that makes no sense; bytes up to the next chunk are lost.
    Record,
    /// A message of a channel that was not declared.
    Channel,
    /// The file ends before its data do: the writer was killed, or the copy is not whole.
    Cut,
}

impl DamageKind {
    /// Short name, `snake_case`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Chunk => "log_chunks_damaged",
            Self::Record => "log_records_damaged",
            Self::Channel => "log_messages_without_channel",
            Self::Cut => "log_cut",
        }
    }
}

/// How often a kind of damage was found, with its first case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// What it is.
    pub kind: DamageKind,
    /// How often.
    pub count: u64,
    /// The first case: file, offset, what is wrong.
    pub first: String,
}

/// Adds one case to a list that holds each kind once, in order of first appearance.
pub(crate) fn count(list: &mut Vec<Damage>, kind: DamageKind, first: impl FnOnce() -> String) {
    match list.iter_mut().find(|damage| damage.kind == kind) {
        Some(damage) => damage.count += 1,
        None => list.push(Damage {
            kind,
            count: 1,
            first: first(),
        }),
    }
}
