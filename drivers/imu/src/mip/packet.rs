//! A MIP packet as bytes: `75 65 | descriptor set | length | fields | checksum`, a field `length |
//! descriptor | data`.
//!
//! Source: 3DM-CV7 data communications protocol, "MIP Packet Overview".

use crate::frames::Framing;

/// Sync bytes, descriptor set, length.
const HEADER: usize = 4;
/// Two bytes of Fletcher's sum.
const CHECKSUM: usize = 2;

/// Fletcher's sum as MIP has it, over everything before: sum of bytes, and sum of sums, each
/// modulo 256.
pub fn checksum(bytes: &[u8]) -> [u8; 2] {
    let (mut sum, mut sums) = (0_u8, 0_u8);
    for byte in bytes {
        sum = sum.wrapping_add(*byte);
        sums = sums.wrapping_add(sum);
    }
    [sum, sums]
}

/// A packet whose checksum was right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// What its fields are about: 0x01 and 0x0C commands and their replies, 0x80 sensor data.
    pub set: u8,
    /// Its fields' bytes.
    pub payload: &'a [u8],
}

impl<'a> Packet<'a> {
    /// A whole frame, as [`MipFraming`] finds it.
    pub fn from_frame(frame: &'a [u8]) -> Option<Self> {
        let (header, rest) = frame.split_first_chunk::<HEADER>()?;
        let (payload, _) = rest.split_at_checked(usize::from(header[3]))?;
        Some(Self {
            set: header[2],
            payload,
        })
    }

    /// Descriptor and data of each field.
    pub fn fields(&self) -> Fields<'a> {
        Fields { rest: self.payload }
    }

    /// A packet's bytes. Fields that do not fit into 255 bytes any more are left out.
    pub fn encode(set: u8, fields: &[(u8, &[u8])]) -> Vec<u8> {
        let mut bytes = [&MipFraming::SYNC[..], &[set, 0]].concat();
        for (descriptor, data) in fields {
            let payload = bytes.len() - HEADER + data.len() + 2;
            let (Ok(length), Ok(payload)) = (u8::try_from(data.len() + 2), u8::try_from(payload))
            else {
                break;
            };
            bytes.extend([length, *descriptor]);
            bytes.extend_from_slice(data);
            bytes[3] = payload;
        }
        bytes.extend(checksum(&bytes));
        bytes
    }
}

/// The fields of a packet. Ends early where a length is impossible.
#[derive(Clone, Debug)]
pub struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Fields<'a> {
    type Item = (u8, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let length = usize::from(*self.rest.first()?);
        let (field, rest) = self.rest.split_at_checked(length)?;
        let (descriptor, data) = field.get(1..)?.split_first()?;
        self.rest = rest;
        Some((*descriptor, data))
    }
}

/// How MIP packets are found.
#[derive(Clone, Copy, Debug, Default)]
pub struct MipFraming;

impl Framing for MipFraming {
    /// "ue".
    const SYNC: [u8; 2] = [0x75, 0x65];
    const LONGEST: usize = HEADER + u8::MAX as usize + CHECKSUM;

    fn length(bytes: &[u8]) -> Option<usize> {
        let payload = bytes.get(3)?;
        Some(HEADER + usize::from(*payload) + CHECKSUM)
    }

    fn is_intact(frame: &[u8]) -> bool {
        frame
            .split_last_chunk::<CHECKSUM>()
            .is_some_and(|(covered, sum)| checksum(covered) == *sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameStart, Frames};
    use proptest::prelude::*;

    /// 3DM-CV7 data communications protocol, "Data Overview", example data packet.
    const MANUAL: [u8; 20] = [
        0x75, 0x65, 0x80, 0x0E, 0x0E, 0x04, 0x3E, 0x7A, 0x63, 0xA0, 0xBB, 0x8E, 0x3B, 0x29, 0x7F,
        0xE5, 0xBF, 0x7F, 0x84, 0xEE,
    ];

    #[test]
    fn the_manuals_example_both_directions() {
        assert_eq!(MipFraming::inspect(&MANUAL), FrameStart::Frame(20));
        let packet = Packet::from_frame(&MANUAL).unwrap();
        let fields: Vec<_> = packet.fields().collect();
        assert_eq!((packet.set, fields.len(), fields[0].0), (0x80, 1, 0x04));
        assert_eq!(Packet::encode(0x80, &fields), MANUAL);
    }

    #[test]
    fn a_payload_that_lies_about_its_fields_ends_early() {
        for payload in [&[0][..], &[1, 4], &[9, 4, 0, 0], &[2]] {
            let packet = Packet { set: 0x80, payload };
            assert_eq!(packet.fields().count(), 0, "{payload:?}");
        }
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_read_back(
            set: u8,
            fields in prop::collection::vec((any::<u8>(), prop::collection::vec(any::<u8>(), 0..40)), 0..6),
        ) {
            let fields: Vec<(u8, &[u8])> = fields.iter().map(|(d, data)| (*d, &data[..])).collect();
            let bytes = Packet::encode(set, &fields);
            prop_assert_eq!(MipFraming::inspect(&bytes), FrameStart::Frame(bytes.len()));
            let packet = Packet::from_frame(&bytes).unwrap();
            prop_assert_eq!(packet.set, set);
            prop_assert_eq!(packet.fields().collect::<Vec<_>>(), fields);
        }

        #[test]
        fn frames_are_found_again_after_anything(
            junk in prop::collection::vec(any::<u8>(), 0..300),
            cut in 1_usize..20,
            pieces in prop::collection::vec(1_usize..50, 1..60),
        ) {
            // What looks like the beginning of a long packet may swallow up to 261 bytes, but not
            // the frames in them.
            let mut stream = junk;
            stream.extend(&MANUAL[..cut]);
            for _ in 0..30 {
                stream.extend(MANUAL);
            }
            let mut frames = Frames::<MipFraming>::default();
            let mut found = 0;
            let mut rest = &stream[..];
            for piece in pieces.iter().cycle() {
                let (now, later) = rest.split_at((*piece).min(rest.len()));
                frames.push(now, &mut |frame| found += u32::from(frame == MANUAL));
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert!(found >= 16, "{found}");
            prop_assert!(frames.counts().junk_bytes <= stream.len() as u64);
        }
    }
}
