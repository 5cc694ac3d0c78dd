//! Packets of the Phidget network protocol: a header of 16 bytes, little-endian, and a JSON text.
//!
//! magic u32, length of the text u32, flags u16, number of the request u16, number of the request
//! that is answered u16, type u8, subtype u8.

/// "PHI0", backwards.
const MAGIC: u32 = 0x5048_4930;
/// Bytes before the text.
const HEADER: usize = 16;
/// No text of a client is longer.
const LONGEST: usize = 65_536;

/// What a packet is.
pub(super) mod flags {
    /// An answer is expected.
    pub const REQUEST: u16 = 1;
    /// It is one.
    pub const REPLY: u16 = 2;
    /// Something happened.
    pub const EVENT: u16 = 4;
}

/// Type and subtype.
pub(super) mod kind {
    /// Client: which protocol.
    pub const HELLO: (u8, u8) = (10, 10);
    /// Server: this one.
    pub const HELLO_REPLY: (u8, u8) = (10, 11);
    /// Client: asks for authentication.
    pub const AUTHENTICATE: (u8, u8) = (10, 30);
    /// Server: the challenge for the password.
    pub const CHALLENGE: (u8, u8) = (10, 31);
    /// Client: the proof.
    pub const PROOF: (u8, u8) = (10, 32);
    /// Server: done, or error code.
    pub const DONE: (u8, u8) = (20, 40);
    /// Either: still there.
    pub const KEEP_ALIVE: (u8, u8) = (20, 41);
    /// Server: a device is there.
    pub const DEVICE: (u8, u8) = (30, 50);
    /// Client: open a channel.
    pub const OPEN: (u8, u8) = (30, 60);
    /// Client: close it.
    pub const CLOSE: (u8, u8) = (30, 65);
    /// Either: something for a channel or from it.
    pub const BRIDGE: (u8, u8) = (30, 70);
}

/// A packet of a client.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Packet {
    pub(super) flags: u16,
    pub(super) number: u16,
    pub(super) kind: (u8, u8),
    pub(super) text: String,
}

/// What is at the beginning of a client's bytes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Parsed {
    /// A packet of this many bytes.
    Packet(Packet, usize),
    /// Less than a packet.
    Incomplete,
    /// No packet.
    Invalid,
}

pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let Some((header, rest)) = bytes.split_first_chunk::<HEADER>() else {
        return Parsed::Incomplete;
    };
    let header = u128::from_le_bytes(*header);
    let length = (header >> 32) as u32 as usize;
    if header as u32 != MAGIC || length > LONGEST {
        return Parsed::Invalid;
    }
    let Some(text) = rest.get(..length) else {
        return Parsed::Incomplete;
    };
    let packet = Packet {
        flags: (header >> 64) as u16,
        number: (header >> 80) as u16,
        kind: ((header >> 112) as u8, (header >> 120) as u8),
        text: String::from_utf8_lossy(text).into_owned(),
    };
    Parsed::Packet(packet, HEADER + length)
}

/// A packet's bytes.
pub(super) fn encode(flags: u16, number: u16, answers: u16, kind: (u8, u8), text: &str) -> Vec<u8> {
    let mut bytes = MAGIC.to_le_bytes().to_vec();
    bytes.extend((text.len() as u32).to_le_bytes());
    for number in [flags, number, answers] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend([kind.0, kind.1]);
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Sent by libphidget22 1.26: the beginning of its first packet.
    #[test]
    fn a_packet_of_the_vendors_library_is_read() {
        let text = r#"{"type":"phid22device","pmajor":2,"pminor":4,"dgram":1,"port":57220}"#;
        let mut bytes = b"0IHP\x44\0\0\0\x01\0\x01\0\0\0\x0a\x0a".to_vec();
        bytes.extend(text.as_bytes());
        let packet = Packet {
            flags: flags::REQUEST,
            number: 1,
            kind: kind::HELLO,
            text: text.to_owned(),
        };
        assert_eq!(parse(&bytes), Parsed::Packet(packet, 84));
        assert_eq!(encode(1, 1, 0, kind::HELLO, text), bytes);
        assert_eq!(parse(&bytes[..83]), Parsed::Incomplete);
        bytes[0] = b'1';
        assert_eq!(parse(&bytes), Parsed::Invalid);
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_read_back(flags: u16, number: u16, kind: (u8, u8), text in ".{0,300}", cut in 0_usize..16) {
            let bytes = encode(flags, number, 0, kind, &text);
            prop_assert_eq!(parse(&bytes[..bytes.len() - 1 - cut.min(bytes.len() - 1)]), Parsed::Incomplete);
            let packet = Packet { flags, number, kind, text };
            prop_assert_eq!(parse(&bytes), Parsed::Packet(packet, bytes.len()));
        }

        #[test]
        fn any_bytes_are_parsed_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            let mut with_magic = MAGIC.to_le_bytes().to_vec();
            with_magic.extend(&bytes);
            parse(&bytes);
            parse(&with_magic);
        }
    }
}
