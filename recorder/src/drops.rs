//! What was not recorded: counted by topic and cause until it can be written.

use crate::Gap;
use randt_messages::{Header, LogDrop, health::fixed_text};

/// Drops that no log lists yet.
#[derive(Debug, Default)]
pub struct Drops {
    /// One of each topic and cause.
    waiting: Vec<(&'static str, Gap)>,
    total: u64,
}

impl Drops {
    /// Counts messages of a topic that were not recorded.
    pub fn add(&mut self, topic: &'static str, gap: &Gap) {
        self.total += gap.count;
        let mut waiting = self.waiting.iter_mut();
        match waiting.find(|(other, drop)| *other == topic && drop.cause == gap.cause) {
            Some((_, drop)) => {
                drop.count += gap.count;
                drop.begin_ns = drop.begin_ns.min(gap.begin_ns);
                drop.end_ns = drop.end_ns.max(gap.end_ns);
            }
            None => self.waiting.push((topic, *gap)),
        }
    }

    /// All messages that were ever dropped here.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// What is to be written; it is then no longer waiting.
    pub fn take(&mut self) -> Vec<LogDrop> {
        let waiting = self.waiting.drain(..);
        waiting.map(|(topic, gap)| gap.message(topic)).collect()
    }
}

impl Gap {
    /// As the log lists it.
    pub(crate) fn message(&self, topic: &str) -> LogDrop {
        LogDrop {
            header: Header {
                stamp_ns: self.end_ns,
                ..Header::default()
            },
            begin_ns: self.begin_ns,
            end_ns: self.end_ns,
            count: self.count,
            topic: fixed_text(topic),
            cause: self.cause as u32,
            reserved: 0,
        }
    }
}
