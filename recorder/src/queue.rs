//! Between the bus and the disk: messages wait here while the disk is busy, up to a budget in
//! bytes.

use crate::{Drops, Gap, Raw};
use randt_messages::{DropCause, LogDrop};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Bytes that may wait. An iSDR-C with everything computed from it makes 1.2 MB/s: the better part
/// of a minute.
pub const BUDGET: usize = 64 << 20;

/// A bounded queue. Pushing never waits for the disk: what finds no room is dropped and counted.
#[derive(Debug)]
pub struct Queue {
    state: Mutex<QueueState>,
    arrived: Condvar,
    budget: usize,
}

#[derive(Debug)]
struct QueueState {
    waiting: VecDeque<Raw>,
    bytes: usize,
    /// Why the next one would be dropped.
    cause: DropCause,
    drops: Drops,
    closed: bool,
}

impl Queue {
    /// An empty one for this many bytes.
    pub fn new(budget: usize) -> Self {
        Self {
            state: Mutex::new(QueueState {
                waiting: VecDeque::new(),
                bytes: 0,
                cause: DropCause::Slow,
                drops: Drops::default(),
                closed: false,
            }),
            arrived: Condvar::new(),
            budget,
        }
    }

    /// Adds messages in their order; the newest are dropped where there is no room, so that gaps
    /// are few and long.
    pub fn push(&self, messages: impl IntoIterator<Item = Raw>, now_ns: i64) {
        let mut state = self.lock();
        let dropped = Gap {
            cause: state.cause,
            count: 1,
            begin_ns: now_ns,
            end_ns: now_ns,
        };
        for raw in messages {
            let bytes = state.bytes + raw.size();
            if bytes > self.budget {
                state.drops.add(raw.topic, &dropped);
            } else {
                state.bytes = bytes;
                state.waiting.push_back(raw);
            }
        }
    }

    /// Counts messages that never came here.
    pub fn missed(&self, topic: &'static str, gap: &Gap) {
        self.lock().drops.add(topic, gap);
    }

    /// The oldest messages, some `bytes_max` of them; empty where none waits.
    pub fn take(&self, bytes_max: usize) -> Vec<Raw> {
        let mut state = self.lock();
        let (mut taken, mut bytes) = (Vec::new(), 0);
        while bytes < bytes_max
            && let Some(raw) = state.waiting.pop_front()
        {
            bytes += raw.size();
            taken.push(raw);
        }
        state.bytes = state.bytes.saturating_sub(bytes);
        taken
    }

    /// Sets why messages would be dropped from now on.
    pub fn set_drop_cause(&self, cause: DropCause) {
        self.lock().cause = cause;
    }

    /// Drops that no log lists yet.
    pub fn take_drops(&self) -> Vec<LogDrop> {
        self.lock().drops.take()
    }

    /// Messages that wait.
    pub fn waiting(&self) -> u64 {
        self.lock().waiting.len() as u64
    }

    /// All messages that were dropped or never came here.
    pub fn lost(&self) -> u64 {
        self.lock().drops.total()
    }

    /// Nothing more comes.
    pub fn close(&self) {
        self.lock().closed = true;
        self.arrived.notify_all();
    }

    /// Whether nothing more comes; sleeps for this time, or until that is so.
    pub fn closes_within(&self, pause: Duration) -> bool {
        let open = |state: &mut QueueState| !state.closed;
        let waited = self.arrived.wait_timeout_while(self.lock(), pause, open);
        waited.unwrap_or_else(PoisonError::into_inner).0.closed
    }

    /// A thread that panicked with the lock has left nothing half done.
    fn lock(&self) -> MutexGuard<'_, QueueState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_log::RecordHeader;
    use randt_messages::health::text_of;

    fn raw(sequence: u32) -> Raw {
        let label = RecordHeader {
            sequence,
            ..RecordHeader::default()
        };
        Raw {
            topic: "a",
            label,
            bytes: vec![0; 1000],
        }
    }

    #[test]
    fn what_finds_no_room_is_counted_with_its_cause() {
        let queue = Queue::new(3 * raw(0).size());
        queue.push((0..5).map(raw), 10);
        queue.set_drop_cause(DropCause::Full);
        queue.push([raw(5)], 20);
        queue.push([raw(6)], 30);
        assert_eq!(queue.lost(), 4);
        let drops = queue.take_drops();
        let listed: Vec<_> = drops
            .iter()
            .map(|d| (text_of(&d.topic), d.cause, d.count, d.begin_ns, d.end_ns))
            .collect();
        let (slow, full) = (DropCause::Slow as u32, DropCause::Full as u32);
        assert_eq!(listed, [("a", slow, 2, 10, 10), ("a", full, 2, 20, 30)]);
        assert!(queue.take_drops().is_empty());
        let left = queue.take(usize::MAX);
        assert_eq!(
            left.iter().map(|r| r.label.sequence).collect::<Vec<_>>(),
            [0, 1, 2]
        );
        queue.push([raw(7)], 40);
        assert_eq!(queue.take(1).len(), 1);
    }
}
