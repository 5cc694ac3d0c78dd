//! What is carried: topics that are sent and that come, and how they get into a frame.

use crate::frame::{Entry, Frame};
use crate::newest::{NewestTopic, Sent};
use crate::stream::{InStream, OutStream};

/// A frame that was sent, as long as its arrival is unknown.
pub struct Unknown {
    pub number: u64,
    pub newest: Vec<Sent>,
    pub streams: Vec<u8>,
}

/// What is to be carried.
#[derive(Default)]
pub struct Cargo {
    /// In the order in which they go.
    pub newest: Vec<NewestTopic>,
    /// Behind those that cannot wait, before the others.
    pub streams: Vec<OutStream>,
    /// What comes.
    pub incoming: Vec<InStream>,
}

/// Puts into a frame what waits of a topic and fits.
pub fn load_newest(
    topic: &mut NewestTopic,
    frame: &mut Frame,
    record: &mut Unknown,
    room: &mut usize,
    now_ns: i64,
) {
    while *room > 0 && topic.bucket.has_some(now_ns) {
        let Some((sent, entry)) = topic.take() else {
            break;
        };
        // A frame is compressed as a whole.
        let bytes = bytes_of(&entry) / NEWEST_COMPRESSION;
        *room = room.saturating_sub(bytes);
        topic.bucket.spend(bytes);
        frame.entries.push(entry);
        record.newest.push(sent);
    }
}

/// Tiles and health are mostly alike: measured at four to ten times.
const NEWEST_COMPRESSION: usize = 4;

/// Bytes of an entry, roughly.
pub fn bytes_of(entry: &Entry) -> usize {
    match entry {
        Entry::Newest(newest) => newest.message.len() + 14,
        Entry::Piece(piece) => piece.bytes.len() + 38,
    }
}
