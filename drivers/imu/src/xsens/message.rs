//! An Xbus message as bytes: `FA | FF | message | length | data | checksum`, where length FF is
//! followed by a u16.
//!
//! Source: MT0101P, "Message structure".

use crate::frames::Framing;

/// A length of this means that a u16 follows.
const EXTENDED: u8 = 0xFF;
/// Longest data, MT0101P.
const DATA_MAX: usize = 2048;

/// A message whose checksum was right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<'a> {
    /// Which message: 0x36 is MTData2.
    pub id: u8,
    /// What it carries.
    pub data: &'a [u8],
}

impl<'a> Message<'a> {
    /// A whole frame, as [`XsensFraming`] finds it.
    pub fn from_frame(frame: &'a [u8]) -> Option<Self> {
        let (data, _checksum) = match frame {
            [_, _, _, EXTENDED, high, low, rest @ ..] => {
                rest.split_at_checked(usize::from(u16::from_be_bytes([*high, *low])))?
            }
            [_, _, _, length, rest @ ..] => rest.split_at_checked(usize::from(*length))?,
            _ => return None,
        };
        let id = *frame.get(2)?;
        Some(Self { id, data })
    }

    /// Its data as items `u16 id | length | data`, as MTData2 has them.
    pub fn items(&self) -> Items<'a> {
        Items { rest: self.data }
    }

    /// A message's bytes; data beyond the protocol's 2048 bytes are left out.
    pub fn encode(id: u8, data: &[u8]) -> Vec<u8> {
        let data = data.get(..DATA_MAX).unwrap_or(data);
        let mut bytes = [&XsensFraming::SYNC[..], &[id]].concat();
        match u8::try_from(data.len()) {
            Ok(length) if length != EXTENDED => bytes.push(length),
            _ => {
                bytes.push(EXTENDED);
                bytes.extend((data.len() as u16).to_be_bytes());
            }
        }
        bytes.extend_from_slice(data);
        bytes.push(sum(&bytes).wrapping_neg());
        bytes
    }
}

/// All but the preamble; with the checksum it is 0.
fn sum(frame: &[u8]) -> u8 {
    let covered = frame.iter().skip(1);
    covered.fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// The items of a message. Ends early where a length is impossible.
#[derive(Clone, Debug)]
pub struct Items<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Items<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let ([high, low, length], rest) = self.rest.split_first_chunk::<3>()?;
        let (data, rest) = rest.split_at_checked(usize::from(*length))?;
        self.rest = rest;
        Some((u16::from_be_bytes([*high, *low]), data))
    }
}

/// How Xbus messages are found.
#[derive(Clone, Copy, Debug, Default)]
pub struct XsensFraming;

impl Framing for XsensFraming {
    /// The preamble, and the master device, the only one there is.
    const SYNC: [u8; 2] = [0xFA, 0xFF];
    const LONGEST: usize = 6 + DATA_MAX + 1;

    fn length(bytes: &[u8]) -> Option<usize> {
        match bytes {
            [_, _, _, EXTENDED, high, low, ..] => {
                Some(6 + usize::from(u16::from_be_bytes([*high, *low])) + 1)
            }
            [_, _, _, EXTENDED, ..] => None,
            [_, _, _, length, ..] => Some(4 + usize::from(*length) + 1),
            _ => None,
        }
    }

    fn is_intact(frame: &[u8]) -> bool {
        sum(frame) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameStart, Frames};
    use proptest::prelude::*;

    /// Messages of einride/xsens-go (MIT), client_test.go.
    #[test]
    fn messages_of_another_driver_both_directions() {
        let configuration = [0x50, 0x40, 0x00, 0x64, 0x20, 0x13, 0x00, 0xC8];
        for (id, data, bytes) in [
            (0x30, &[][..], &[0xFA, 0xFF, 0x30, 0x00, 0xD1][..]),
            (0x31, &[], &[0xFA, 0xFF, 0x31, 0x00, 0xD0]),
            (0x10, &[], &[0xFA, 0xFF, 0x10, 0x00, 0xF1]),
            (0x36, &[], &[0xFA, 0xFF, 0x36, 0x00, 0xCB]),
            (
                0xC0,
                &configuration,
                &[
                    0xFA, 0xFF, 0xC0, 0x08, 0x50, 0x40, 0x00, 0x64, 0x20, 0x13, 0x00, 0xC8, 0x4A,
                ],
            ),
        ] {
            assert_eq!(Message::encode(id, data), bytes);
            assert_eq!(XsensFraming::inspect(bytes), FrameStart::Frame(bytes.len()));
            assert_eq!(Message::from_frame(bytes), Some(Message { id, data }));
        }
    }

    #[test]
    fn a_length_beyond_the_protocols_is_junk() {
        let bytes = [0xFA, 0xFF, 0x36, 0xFF, 0xFF, 0xFF, 0, 0];
        assert_eq!(XsensFraming::inspect(&bytes), FrameStart::Junk);
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_read_back(id: u8, data in prop::collection::vec(any::<u8>(), 0..600)) {
            let bytes = Message::encode(id, &data);
            prop_assert_eq!(XsensFraming::inspect(&bytes), FrameStart::Frame(bytes.len()));
            prop_assert_eq!(Message::from_frame(&bytes), Some(Message { id, data: &data }));
        }

        #[test]
        fn every_byte_is_a_frames_or_junk(stream in prop::collection::vec(any::<u8>(), 0..600), piece in 1_usize..50) {
            let mut frames = Frames::<XsensFraming>::default();
            let mut framed = 0;
            for piece in stream.chunks(piece) {
                frames.push(piece, &mut |frame| framed += frame.len() as u64);
            }
            frames.cut();
            prop_assert_eq!(framed + frames.counts().junk_bytes, stream.len() as u64);
        }
    }
}
