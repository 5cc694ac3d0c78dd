//! A frame: what goes over the link at once, in either direction, as bytes and back.

use randt_messages::BUS_TOPICS;

/// Of this form of frames.
const VERSION: u8 = 1;
/// Longest body after decompression: a damaged length must not take memory.
const BODY_MAX: usize = 1 << 20;
/// Level of zstd: higher ones gain little on bodies of a few hundred bytes.
const LEVEL: i32 = 3;

/// How far a reader has got with a stream of messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// Which series the numbers belong to: keyframes are numbered from 0 in each drive.
    pub series: i64,
    /// The next message.
    pub id: u64,
    /// The next byte of that message.
    pub offset: u32,
}

/// The newest message under a key of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewestMessage {
    pub topic: u8,
    pub key: u64,
    pub message: Vec<u8>,
}

/// A part of a message of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    pub topic: u8,
    pub at: Position,
    /// There is no message from this number up to it: who wants one of them goes on with it.
    pub after: u64,
    /// Bytes of the whole message.
    pub total: u32,
    pub bytes: Vec<u8>,
}

/// One thing that a frame carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    Newest(NewestMessage),
    Piece(Piece),
}

/// A frame: who sends it and to whom, what has come from there, and what it carries. Everything
/// goes along with everything else, because each frame costs its overhead; hence its fields.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// The sender's session: another process, another session.
    pub session: u64,
    /// What the receiver has asked the sender to show; 0 where it has not yet asked. A stream that
    /// somebody has recorded does not have it.
    pub proof: u64,
    /// What the sender asks the receiver to show, and the session that it asks.
    pub challenge: u64,
    pub challenged: u64,
    /// From 1, without gaps.
    pub number: u64,
    /// The sender's clock, ns.
    pub sent_ns: i64,
    /// `sent_ns` of the receiver's last frame, and how long ago that came; 0 and 0 where none did.
    pub echo_ns: i64,
    pub held_ns: i64,
    /// Highest number of the receiver's frames that has come, and which of the 64 up to it.
    pub highest: u64,
    pub arrived: u64,
    /// The newest mark that has come, 0 where none did since the last frame, and how long ago.
    pub mark_back: u64,
    pub mark_held_ns: i64,
    /// Bytes sent so far, where the receiver shall give it back; 0 where not.
    pub mark: u64,
    /// Of each stream of the receiver's what is wanted next.
    pub wanted: Vec<(u8, Position)>,
    /// What it carries.
    pub entries: Vec<Entry>,
}

/// Why bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// They are not.
    #[error("bytes that are no frame")]
    NoFrame,
    /// The other end's messages have another layout.
    #[error("the other end runs another build: its messages have another layout")]
    OtherBuild,
}

/// A number for the layouts of all topics.
pub fn layout() -> u64 {
    let names = BUS_TOPICS.iter().flat_map(|topic| topic.type_name.bytes());
    fnv(names)
}

/// FNV-1a.
pub fn fnv(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

impl Frame {
    /// Its bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = vec![VERSION];
        for number in [layout(), self.session, self.proof] {
            out.extend(number.to_le_bytes());
        }
        let numbers = [
            self.challenge,
            self.challenged,
            self.number,
            self.sent_ns as u64,
            self.echo_ns as u64,
            self.held_ns as u64,
            self.highest,
            // Mostly all have come.
            !self.arrived,
            self.mark_back,
            self.mark_held_ns as u64,
            self.mark,
        ];
        for number in numbers {
            put_number(number, &mut out);
        }
        out.push(self.wanted.len() as u8);
        for (topic, position) in &self.wanted {
            out.push(*topic);
            put_position(position, &mut out);
        }
        let mut body = Vec::new();
        for entry in &self.entries {
            put_entry(entry, &mut body);
        }
        if body.is_empty() {
            return out;
        }
        match zstd::bulk::compress(&body, LEVEL) {
            Ok(packed) if packed.len() < body.len() => {
                out.push(1);
                out.extend(packed);
            }
            _ => {
                out.push(0);
                out.extend(body);
            }
        }
        out
    }

    /// A frame from bytes that may be anything.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut rest = Rest(bytes);
        if rest.byte()? != VERSION {
            return Err(Error::OtherBuild);
        }
        if rest.number()? != layout() {
            return Err(Error::OtherBuild);
        }
        let mut frame = Self {
            session: rest.number()?,
            proof: rest.number()?,
            challenge: rest.short()?,
            challenged: rest.short()?,
            number: rest.short()?,
            sent_ns: rest.short()? as i64,
            echo_ns: rest.short()? as i64,
            held_ns: rest.short()? as i64,
            highest: rest.short()?,
            arrived: !rest.short()?,
            mark_back: rest.short()?,
            mark_held_ns: rest.short()? as i64,
            mark: rest.short()?,
            ..Self::default()
        };
        for _ in 0..rest.byte()? {
            frame.wanted.push((rest.byte()?, rest.position()?));
        }
        if rest.0.is_empty() {
            return Ok(frame);
        }
        let body = match rest.byte()? {
            0 => rest.0.to_vec(),
            1 => zstd::bulk::decompress(rest.0, BODY_MAX).map_err(|_| Error::NoFrame)?,
            _ => return Err(Error::NoFrame),
        };
        let mut body = Rest(&body);
        while !body.0.is_empty() {
            frame.entries.push(body.entry()?);
        }
        Ok(frame)
    }
}

/// Seven bits a byte, the least first: a frame of the slowest link is mostly head.
fn put_number(mut number: u64, out: &mut Vec<u8>) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

fn put_position(position: &Position, out: &mut Vec<u8>) {
    out.extend(position.series.to_le_bytes());
    out.extend(position.id.to_le_bytes());
    out.extend(position.offset.to_le_bytes());
}

fn put_entry(entry: &Entry, out: &mut Vec<u8>) {
    match entry {
        Entry::Newest(newest) => {
            out.extend([0, newest.topic]);
            out.extend(newest.key.to_le_bytes());
            put_bytes(&newest.message, out);
        }
        Entry::Piece(piece) => {
            out.extend([1, piece.topic]);
            put_position(&piece.at, out);
            out.extend(piece.after.to_le_bytes());
            out.extend(piece.total.to_le_bytes());
            put_bytes(&piece.bytes, out);
        }
    }
}

fn put_bytes(bytes: &[u8], out: &mut Vec<u8>) {
    out.extend((bytes.len() as u32).to_le_bytes());
    out.extend(bytes);
}

/// Bytes that are left to be read.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let (array, rest) = self.0.split_first_chunk().ok_or(Error::NoFrame)?;
        self.0 = rest;
        Ok(*array)
    }

    fn byte(&mut self) -> Result<u8, Error> {
        let [byte] = self.array()?;
        Ok(byte)
    }

    fn number(&mut self) -> Result<u64, Error> {
        self.array().map(u64::from_le_bytes)
    }

    /// What [`put_number`] wrote.
    fn short(&mut self) -> Result<u64, Error> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(Error::NoFrame)
    }

    fn length(&mut self) -> Result<u32, Error> {
        self.array().map(u32::from_le_bytes)
    }

    fn bytes(&mut self) -> Result<Vec<u8>, Error> {
        let length = self.length()? as usize;
        let (bytes, rest) = self.0.split_at_checked(length).ok_or(Error::NoFrame)?;
        self.0 = rest;
        Ok(bytes.to_vec())
    }

    fn position(&mut self) -> Result<Position, Error> {
        Ok(Position {
            series: self.number()? as i64,
            id: self.number()?,
            offset: self.length()?,
        })
    }

    fn entry(&mut self) -> Result<Entry, Error> {
        let (kind, topic) = (self.byte()?, self.byte()?);
        match kind {
            0 => Ok(Entry::Newest(NewestMessage {
                topic,
                key: self.number()?,
                message: self.bytes()?,
            })),
            1 => Ok(Entry::Piece(Piece {
                topic,
                at: self.position()?,
                after: self.number()?,
                total: self.length()?,
                bytes: self.bytes()?,
            })),
            _ => Err(Error::NoFrame),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    fn frame() -> Frame {
        let at = Position {
            series: -3,
            id: 7,
            offset: 2,
        };
        Frame {
            session: 5,
            proof: 6,
            number: 9,
            sent_ns: -1,
            wanted: vec![(5, at)],
            entries: vec![
                Entry::Newest(NewestMessage {
                    topic: 4,
                    key: 2,
                    message: vec![3; 300],
                }),
                Entry::Piece(Piece {
                    topic: 5,
                    at,
                    after: 7,
                    total: 4,
                    bytes: vec![1, 2],
                }),
            ],
            ..Frame::default()
        }
    }

    #[test]
    fn a_frame_comes_back_and_what_is_none_is_refused() {
        let bytes = frame().to_bytes();
        assert_eq!(Frame::from_bytes(&bytes), Ok(frame()));
        for end in 0..bytes.len() {
            // Cut behind the head it is a frame without entries.
            assert_ne!(Frame::from_bytes(&bytes[..end]), Ok(frame()), "{end}");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << bit;
                // Whatever it is, it is no panic and no memory without end.
                let _ = Frame::from_bytes(&bytes);
            }
        }
        let mut other = bytes;
        other[1] ^= 1;
        assert_eq!(Frame::from_bytes(&other), Err(Error::OtherBuild));
    }
}
