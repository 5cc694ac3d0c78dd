//! Topics of which every message is sent, in order: each end knows how far the other one is.

use crate::bucket::Bucket;
use crate::frame::{Entry, Piece, Position};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Memory for messages of a topic that has no journal, bytes; older ones are lost beyond it.
const MEMORY: usize = 4 << 20;
/// A message that claims to be longer is none: a keyframe has one megabyte at most.
const MESSAGE_MAX: u32 = 1 << 22;

/// Messages by their number.
pub trait Source {
    /// Which series the numbers belong to.
    fn series(&self) -> i64;
    /// The first number from this one on that there is.
    fn first_from(&self, id: u64) -> Option<u64>;
    /// A message.
    fn get(&mut self, id: u64) -> Option<Vec<u8>>;
    /// All before this one have arrived.
    fn forget_before(&mut self, id: u64);
}

/// The last messages, in memory.
#[derive(Debug)]
pub struct MemorySource {
    series: i64,
    first: u64,
    messages: VecDeque<Vec<u8>>,
    bytes: usize,
    /// Messages that had to go before they arrived.
    pub lost: u64,
}

impl MemorySource {
    /// Empty. `series`: of this process alone.
    pub fn new(series: i64) -> Self {
        Self {
            series,
            first: 0,
            messages: VecDeque::new(),
            bytes: 0,
            lost: 0,
        }
    }

    /// Takes a message.
    pub fn push(&mut self, message: Vec<u8>) {
        self.bytes += message.len();
        self.messages.push_back(message);
        while self.bytes > MEMORY {
            self.drop_first();
            self.lost += 1;
        }
    }

    fn drop_first(&mut self) {
        if let Some(message) = self.messages.pop_front() {
            self.bytes -= message.len();
            self.first += 1;
        }
    }
}

impl Source for MemorySource {
    fn series(&self) -> i64 {
        self.series
    }

    fn first_from(&self, id: u64) -> Option<u64> {
        let id = id.max(self.first);
        (id < self.first + self.messages.len() as u64).then_some(id)
    }

    fn get(&mut self, id: u64) -> Option<Vec<u8>> {
        let index = id.checked_sub(self.first)?;
        self.messages.get(index as usize).cloned()
    }

    fn forget_before(&mut self, id: u64) {
        while self.first < id && !self.messages.is_empty() {
            self.drop_first();
        }
    }
}

/// The sending end of one topic.
pub struct OutStream {
    pub topic: u8,
    source: Rc<RefCell<dyn Source>>,
    /// What goes next.
    cursor: Position,
    /// What the other end wanted last.
    wanted: Option<Position>,
    /// Frames up to this number were sent before the last step back.
    stepped_back: u64,
    /// The message at the cursor.
    message: Option<Waiting>,
    pub bucket: Bucket,
}

/// A message that is being sent.
struct Waiting {
    series: i64,
    id: u64,
    /// There is no message from this number up to it.
    after: u64,
    bytes: Vec<u8>,
}

impl OutStream {
    /// From a source. `rate`: bytes a second, 0 for no limit.
    pub fn new(topic: u8, source: Rc<RefCell<dyn Source>>, rate: f64) -> Self {
        Self {
            topic,
            source,
            cursor: Position::default(),
            wanted: None,
            stepped_back: 0,
            message: None,
            bucket: Bucket::new(rate),
        }
    }

    /// Whether something waits.
    pub fn is_waiting(&self) -> bool {
        let source = self.source.borrow();
        let next = match self.cursor.series == source.series() {
            true => self.cursor.id,
            false => 0,
        };
        source.first_from(next).is_some()
    }

    /// The next part, of at most this many bytes.
    pub fn take(&mut self, bytes_max: usize) -> Option<Entry> {
        let mut source = self.source.borrow_mut();
        let series = source.series();
        if self.cursor.series != series {
            self.cursor = Position {
                series,
                ..Position::default()
            };
        }
        let is_at = |id| move |it: &Waiting| (it.series, it.id) == (series, id);
        // What was begun is ended, also where the source has dropped it meanwhile: else a source
        // that gets more than goes would lose each message on its way.
        let is_begun =
            self.cursor.offset > 0 && self.message.as_ref().is_some_and(is_at(self.cursor.id));
        let id = match is_begun {
            true => self.cursor.id,
            false => source.first_from(self.cursor.id)?,
        };
        if !self.message.as_ref().is_some_and(is_at(id)) {
            self.message = Some(Waiting {
                series,
                id,
                after: self.cursor.id,
                bytes: source.get(id)?,
            });
        }
        if id != self.cursor.id {
            (self.cursor.id, self.cursor.offset) = (id, 0);
        }
        let message = self.message.as_ref()?;
        let (after, message) = (message.after.min(id), &message.bytes);
        let rest = message.get(self.cursor.offset as usize..);
        // Another build packs otherwise: begin again.
        let rest = rest.filter(|rest| !rest.is_empty()).unwrap_or_else(|| {
            self.cursor.offset = 0;
            message
        });
        let bytes = rest.get(..bytes_max).unwrap_or(rest).to_vec();
        let at = self.cursor;
        self.cursor.offset += bytes.len() as u32;
        if self.cursor.offset as usize >= message.len() {
            (self.cursor.id, self.cursor.offset) = (self.cursor.id + 1, 0);
        }
        Some(Entry::Piece(Piece {
            topic: self.topic,
            at,
            after,
            total: message.len() as u32,
            bytes,
        }))
    }

    /// What the other end wants next. `number`: the last frame that was sent.
    pub fn set_wanted(&mut self, wanted: Position, number: u64) {
        let is_series = wanted.series == self.source.borrow().series();
        let is_back = self.wanted.is_some_and(|last| wanted < last);
        // Its first word, or it has fewer than it had: another process of it, or its mapper lacks
        // some.
        if is_series && (self.wanted.is_none() || is_back) {
            self.cursor = wanted;
            self.stepped_back = number;
        }
        if is_series {
            self.source.borrow_mut().forget_before(wanted.id);
        }
        self.wanted = Some(wanted);
    }

    /// A part of it in frame `lost` did not arrive: goes back to what is wanted. `number`: the last
    /// frame that was sent.
    pub fn lost(&mut self, lost: u64, number: u64) {
        if lost > self.stepped_back {
            self.cursor = self.wanted.unwrap_or_default();
            self.stepped_back = number;
        }
    }

    /// Another process is at the other end.
    pub fn begin_anew(&mut self, number: u64) {
        (self.wanted, self.cursor) = (None, Position::default());
        self.stepped_back = number;
    }
}

/// The receiving end of one topic.
#[derive(Debug)]
pub struct InStream {
    pub topic: u8,
    wanted: Position,
    bytes: Vec<u8>,
    /// Messages that the sender no longer had.
    pub lost: u64,
    /// Whether it has taken anything, or was asked for a number.
    has_begun: bool,
}

impl InStream {
    /// Goes on at a position.
    pub fn new(topic: u8, wanted: Option<Position>) -> Self {
        Self {
            topic,
            wanted: wanted.unwrap_or_default(),
            bytes: Vec::new(),
            lost: 0,
            has_begun: wanted.is_some(),
        }
    }

    /// What is wanted next.
    pub fn wanted(&self) -> Position {
        self.wanted
    }

    /// Wants an earlier message once more.
    pub fn go_back(&mut self, id: u64) {
        self.wanted.id = id;
        self.restart();
    }

    /// Takes a part where it is the one that is wanted; gives the message, once it is whole.
    pub fn take(&mut self, piece: &Piece) -> Option<Vec<u8>> {
        let (at, after) = (piece.at, piece.after);
        let is_other = at.series != self.wanted.series;
        if is_other && (at.offset != 0 || after != 0) {
            return None;
        }
        if is_other {
            self.wanted = Position {
                series: at.series,
                ..Position::default()
            };
            self.restart();
        }
        if at.offset == 0 && (after..at.id).contains(&self.wanted.id) {
            // What a first process at this end has not seen is not lost.
            if self.has_begun && !is_other {
                self.lost += at.id - self.wanted.id;
            }
            self.wanted.id = at.id;
            self.restart();
        }
        if at.id == self.wanted.id && at.offset == 0 && self.wanted.offset > 0 {
            // The sender began it again.
            self.restart();
        }
        if at != self.wanted || piece.total > MESSAGE_MAX {
            return None;
        }
        self.has_begun = true;
        self.bytes.extend_from_slice(&piece.bytes);
        self.wanted.offset += piece.bytes.len() as u32;
        if self.wanted.offset < piece.total {
            return None;
        }
        self.wanted.id += 1;
        self.wanted.offset = 0;
        Some(std::mem::take(&mut self.bytes))
    }

    fn restart(&mut self) {
        self.wanted.offset = 0;
        self.bytes.clear();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    fn streams() -> (Rc<RefCell<MemorySource>>, OutStream, InStream) {
        let source = Rc::new(RefCell::new(MemorySource::new(3)));
        let out = OutStream::new(1, source.clone(), 0.0);
        (source, out, InStream::new(1, None))
    }

    fn carry(out: &mut OutStream, into: &mut InStream) -> Option<Vec<u8>> {
        match out.take(4) {
            Some(Entry::Piece(piece)) => into.take(&piece),
            _ => None,
        }
    }

    /// A whole message of one byte.
    fn whole(series: i64, id: u64, after: u64) -> Piece {
        let offset = 0;
        Piece {
            topic: 1,
            at: Position { series, id, offset },
            after,
            total: 1,
            bytes: vec![7],
        }
    }

    #[test]
    fn messages_come_whole_in_order_and_once_whatever_is_lost() {
        let (source, mut out, mut into) = streams();
        for n in 0..20_u8 {
            source.borrow_mut().push(vec![n; 1 + n as usize % 11]);
        }
        let mut found = Vec::new();
        let mut number = 0;
        while out.is_waiting() || found.len() < 20 {
            number += 1;
            assert!(number < 1000);
            if number % 3 == 0 {
                // This one and those behind it do not arrive.
                for _ in 0..number % 5 {
                    out.take(4);
                }
                number += 5;
                out.set_wanted(into.wanted(), number);
                out.lost(number - 4, number);
                out.lost(number - 3, number);
            }
            found.extend(carry(&mut out, &mut into));
        }
        let sent: Vec<Vec<u8>> = (0..20).map(|n: u8| vec![n; 1 + n as usize % 11]).collect();
        assert_eq!((found, into.lost), (sent, 0));
    }

    #[test]
    fn what_is_there_no_more_is_counted_and_another_series_begins_at_its_front() {
        let (source, mut out, mut into) = streams();
        source.borrow_mut().push(vec![0]);
        assert_eq!(carry(&mut out, &mut into), Some(vec![0]));
        for n in 1..6 {
            source.borrow_mut().push(vec![n]);
        }
        source.borrow_mut().forget_before(4);
        // One that runs ahead of what is missing is not taken.
        assert_eq!(into.take(&whole(3, 5, 5)), None);
        assert_eq!(carry(&mut out, &mut into), Some(vec![4]));
        assert_eq!((carry(&mut out, &mut into), into.lost), (Some(vec![5]), 3));
        assert_eq!(into.take(&whole(9, 2, 2)), None, "not its front");
        assert_eq!(into.take(&whole(9, 2, 0)), Some(vec![7]));
        assert_eq!(into.lost, 3);
    }
}
