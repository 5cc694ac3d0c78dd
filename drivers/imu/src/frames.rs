//! Frames out of a stream of bytes.
//!
//! Responsible for finding them again after anything: junk, half a frame, a byte that was changed.
//! Where a checksum is wrong the search goes on one byte further, so that a good frame inside a
//! bad one is not lost. Not responsible for what is in a frame.

use std::marker::PhantomData;

/// What stands at the beginning of the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameStart {
    /// No frame begins here.
    Junk,
    /// A frame may begin here, and more bytes are needed to know.
    Incomplete,
    /// A frame of this many bytes, its checksum right.
    Frame(usize),
    /// A frame to its end, its checksum wrong.
    Damaged,
}

/// How a protocol frames what it sends: two sync bytes, a length (fixed or in a header), data, a
/// checksum.
pub trait Framing {
    /// The first two bytes.
    const SYNC: [u8; 2];
    /// The bytes of the longest frame, sync and checksum included.
    const LONGEST: usize;

    /// The bytes of the frame that begins with `bytes`, sync and checksum included; none while its
    /// header is not whole.
    fn length(bytes: &[u8]) -> Option<usize>;

    /// Whether the checksum of a whole frame is right.
    fn is_intact(frame: &[u8]) -> bool;

    /// What is at the beginning of `bytes`, which are not empty. Asks for no more bytes than
    /// [`Self::LONGEST`].
    fn inspect(bytes: &[u8]) -> FrameStart {
        if bytes
            .iter()
            .zip(Self::SYNC)
            .any(|(byte, sync)| *byte != sync)
        {
            return FrameStart::Junk;
        }
        let Some(length) = Self::length(bytes) else {
            return FrameStart::Incomplete;
        };
        if length > Self::LONGEST {
            return FrameStart::Junk;
        }
        match bytes.get(..length) {
            None => FrameStart::Incomplete,
            Some(frame) if Self::is_intact(frame) => FrameStart::Frame(length),
            Some(_) => FrameStart::Damaged,
        }
    }
}

/// What was counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames whose checksum was right.
    pub frames: u64,
    /// Frames whose checksum was wrong.
    pub checksum_errors: u64,
    /// Bytes that belong to no good frame.
    pub junk_bytes: u64,
}

/// The bytes that are not yet a whole frame.
#[derive(Debug, Default)]
pub struct Frames<F> {
    bytes: Vec<u8>,
    counts: FrameCounts,
    framing: PhantomData<F>,
}

impl<F: Framing> Frames<F> {
    /// Takes what was read, gives every whole frame.
    pub fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(&[u8])) {
        self.bytes.extend_from_slice(bytes);
        let mut begin = 0;
        while let Some(rest) = self.bytes.get(begin..).filter(|rest| !rest.is_empty()) {
            match F::inspect(rest) {
                FrameStart::Incomplete => break,
                FrameStart::Frame(length) => {
                    self.counts.frames += 1;
                    take(rest.get(..length).unwrap_or(rest));
                    begin += length.max(1);
                }
                start => {
                    self.counts.checksum_errors += u64::from(start == FrameStart::Damaged);
                    self.counts.junk_bytes += 1;
                    begin += 1;
                }
            }
        }
        self.bytes.drain(..begin.min(self.bytes.len()));
    }

    /// Forgets half a frame: what follows comes from another open port.
    pub fn cut(&mut self) {
        self.counts.junk_bytes += self.bytes.len() as u64;
        self.bytes.clear();
    }

    /// What was counted so far.
    pub fn counts(&self) -> FrameCounts {
        self.counts
    }
}
