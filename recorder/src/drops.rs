//! What was not recorded: counted by topic and cause until it can be written.

use crate::Gap;
use randt_messages::{DropCause, Header, LogDrop, health::fixed_text};

/// Drops that no log lists yet.
#[derive(Debug, Default)]
pub struct Drops {
    waiting: Vec<PendingDrop>,
    total: u64,
}

#[derive(Debug)]
struct PendingDrop {
    topic: &'static str,
    cause: DropCause,
    count: u64,
    begin_ns: i64,
    end_ns: i64,
}

impl Drops {
    /// Counts messages of a topic that were not recorded.
    pub fn add(&mut self, topic: &'static str, gap: &Gap) {
        let Gap {
            cause,
            count,
            begin_ns,
            end_ns,
        } = *gap;
        self.total += count;
        let same = |drop: &&mut PendingDrop| drop.topic == topic && drop.cause == cause;
        match self.waiting.iter_mut().find(same) {
            Some(drop) => {
                drop.count += count;
                drop.begin_ns = drop.begin_ns.min(begin_ns);
                drop.end_ns = drop.end_ns.max(end_ns);
            }
            None => self.waiting.push(PendingDrop {
                topic,
                cause,
                count,
                begin_ns,
                end_ns,
            }),
        }
    }

    /// All messages that were ever dropped here.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// What is to be written; it is then no longer waiting.
    pub fn take(&mut self) -> Vec<LogDrop> {
        self.waiting.drain(..).map(|drop| drop.message()).collect()
    }
}

impl PendingDrop {
    fn message(&self) -> LogDrop {
        LogDrop {
            header: Header {
                stamp_ns: self.end_ns,
                ..Header::default()
            },
            begin_ns: self.begin_ns,
            end_ns: self.end_ns,
            count: self.count,
            topic: fixed_text(self.topic),
            cause: self.cause as u32,
            reserved: 0,
        }
    }
}
