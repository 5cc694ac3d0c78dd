//! `log/drop`: messages that a log lacks.

use crate::{Header, layout::coded, plain};

coded! {
    /// Why messages were not recorded.
    pub enum DropCause {
        /// The recorder did not see them: it was away or slower than the bus.
        #[default]
        Missed = 0 => "missed",
        /// The disk was slower than the data for longer than memory lasts.
        Slow = 1 => "disk-slow",
        /// Too little space was left on the disk.
        Full = 2 => "disk-full",
        /// They could not be written, or were lost again with the file.
        Failed = 3 => "disk-failed",
        /// Their publisher was replaced while no recorder ran, and what it sent last is lost. The
        /// count says how often that happened, because the number of messages is unknown.
        Replaced = 4 => "publisher-replaced",
    }
}

impl DropCause {
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
        #[code(DropCause)]
        pub cause: u32,
        /// Zero.
        pub reserved: u32,
    }
}
