//! Frames out of a stream of bytes.
//!
//! Responsible for finding them again after anything: junk, half a frame, a byte that was changed. Where a checksum is
//! wrong the search goes on one byte further, so that a good frame inside a bad one is not lost. Not responsible for
//! what is in a frame.

use std::marker::PhantomData;

/// What a protocol sees at the beginning of the bytes that it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// No frame begins here.
    Junk,
    /// A frame may begin here, and more bytes are needed to know.
    More,
    /// A frame of so many bytes, its checksum right.
    Frame(usize),
    /// A frame to its end, its checksum wrong.
    Damaged,
}

/// How a protocol's frames look.
pub trait Framing {
    /// What is at the beginning of `bytes`, which are not empty. Asks for no more bytes than its longest frame has.
    fn look(bytes: &[u8]) -> Look;
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
#[derive(Debug)]
pub struct Frames<F> {
    bytes: Vec<u8>,
    counts: FrameCounts,
    framing: PhantomData<F>,
}

impl<F: Framing> Default for Frames<F> {
    fn default() -> Self {
        Self {
            bytes: Vec::new(),
            counts: FrameCounts::default(),
            framing: PhantomData,
        }
    }
}

impl<F: Framing> Frames<F> {
    /// Takes what was read, gives every whole frame.
    pub fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(&[u8])) {
        self.bytes.extend_from_slice(bytes);
        let mut begin = 0;
        while let Some(rest) = self.bytes.get(begin..).filter(|rest| !rest.is_empty()) {
            match F::look(rest) {
                Look::More => break,
                Look::Frame(length) => {
                    self.counts.frames += 1;
                    take(rest.get(..length).unwrap_or(rest));
                    begin += length.max(1);
                }
                look => {
                    self.counts.checksum_errors += u64::from(look == Look::Damaged);
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
