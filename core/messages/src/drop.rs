//! `log/drop`: what a log should hold and does not.

use crate::{Header, plain, topic};

/// Why messages were not recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum DropCause {
    /// The recorder did not see them: it was away or slower than the bus.
    Missed = 0,
    /// The disk was slower than the data for longer than memory lasts.
    Slow = 1,
    /// Too little space was left on the disk.
    Full = 2,
    /// The disk or the folder did not take them, or lost them again.
    Failed = 3,
    /// Their publisher was replaced while nobody recorded: what it sent last went with it. Counted is how often that
    /// happened, because nobody knows the number of messages.
    Replaced = 4,
}

impl DropCause {
    /// The cause of a code; `Missed` for any other.
    pub fn from_code(code: u32) -> Self {
        match code {
            1 => Self::Slow,
            2 => Self::Full,
            3 => Self::Failed,
            4 => Self::Replaced,
            _ => Self::Missed,
        }
    }

    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Missed => "missed on the bus",
            Self::Slow => "disk too slow",
            Self::Full => "disk full",
            Self::Failed => "disk failed",
            Self::Replaced => "publisher replaced while nobody recorded, number unknown",
        }
    }
}

plain! {
    /// Messages of one topic that were not recorded, for one cause, between two instants.
    pub struct LogDrop {
        /// Stamp: the end.
        pub header: Header,
        /// When the first of them was to be recorded, ns.
        pub begin_ns: i64,
        /// When the last of them was, ns.
        pub end_ns: i64,
        /// How many; with [`DropCause::Replaced`] how often.
        pub count: u64,
        /// Name of the topic, in UTF-8, filled with zeros.
        pub topic: [u8; 32],
        /// A [`DropCause`] as its code.
        pub cause: u32,
        /// Zero.
        pub reserved: u32,
    }
}

topic! {
    /// Topic of [`LogDrop`]; only in logs, never on the bus.
    LogDropTopic = "log/drop/v1": LogDrop, [(); 0];
}
