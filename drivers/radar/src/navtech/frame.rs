//! Colossus messages out of a stream of bytes, and into one.
//!
//! Source: Navtech's IASDK (MIT), `Colossus_network_message` and the network tests.

use crate::bytes::Bytes;

/// What every message begins with.
pub const SIGNATURE: [u8; 16] = [
    0x00, 0x01, 0x03, 0x03, 0x07, 0x07, 0x0f, 0x0f, 0x1f, 0x1f, 0x3f, 0x3f, 0x7f, 0x7f, 0xfe, 0xfe,
];
/// Signature, version, type, length.
pub const HEADER_BYTES: usize = 22;
/// Longest plausible payload: 65,536 bins of 16 bit would be 128 kB.
pub const PAYLOAD_MAX: usize = 1 << 20;
/// The version of today; some vendor programs send 0.
pub const VERSION: u8 = 1;

/// Types of messages that this driver or its emulator knows.
pub mod kind {
    /// Both ways, no body.
    pub const KEEP_ALIVE: u8 = 1;
    /// From the radar, unasked on connecting.
    pub const CONFIGURATION: u8 = 10;
    /// To the radar, no body.
    pub const CONFIGURATION_REQUEST: u8 = 20;
    /// To the radar, no body: begin to send.
    pub const START_FFT: u8 = 21;
    /// To the radar, no body.
    pub const STOP_FFT: u8 = 22;
    /// From the radar: a beam, one byte a bin.
    pub const FFT_8: u8 = 30;
    /// From the radar: a beam, two bytes a bin.
    pub const FFT_16: u8 = 31;
    /// From the radar: protobuf.
    pub const HEALTH: u8 = 40;
    /// To the radar, no body: begin to send, contour or not.
    pub const START_FFT_WITHOUT_CONTOUR: u8 = 140;
}

/// One message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// As sent: 0 or 1.
    pub version: u8,
    /// See [`kind`].
    pub kind: u8,
    /// The body.
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// Appends the message's bytes. A payload over [`PAYLOAD_MAX`] is written all the same;
    /// readers refuse it.
    pub fn encode(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&SIGNATURE);
        out.extend_from_slice(&[self.version, self.kind]);
        out.extend_from_slice(&(self.payload.len() as u32).to_be_bytes());
        out.extend_from_slice(self.payload);
    }
}

/// Appends a message without a body.
pub fn command(version: u8, kind: u8, out: &mut Vec<u8>) {
    Frame {
        version,
        kind,
        payload: &[],
    }
    .encode(out);
}

/// What was passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameFaults {
    /// Bytes that belong to no message.
    pub junk_bytes: u64,
    /// Headers of an unknown version.
    pub versions: u64,
    /// Headers that announce more than [`PAYLOAD_MAX`].
    pub oversize: u64,
    /// Messages in whose midst the next one begins.
    pub cut: u64,
}

/// Takes pieces of the stream, gives messages. Where one does not begin with the signature, it
/// searches the next that does, byte by byte.
#[derive(Debug, Default)]
pub struct FrameParser {
    buffer: Vec<u8>,
    begin: usize,
    faults: FrameFaults,
}

impl FrameParser {
    /// Takes the next piece; whole messages should have been taken out before.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.begin);
        self.begin = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// The next whole message.
    #[allow(clippy::should_implement_trait, reason = "it lends out of itself")]
    pub fn next(&mut self) -> Option<Frame<'_>> {
        let (version, kind, length) = loop {
            self.skip_junk();
            let mut header = Bytes(self.rest());
            header.array::<16>()?;
            let (version, kind) = (header.u8()?, header.u8()?);
            let length = header.u32_be()? as usize;
            if version > VERSION {
                self.faults.versions += 1;
            } else if length > PAYLOAD_MAX {
                self.faults.oversize += 1;
            } else {
                // What has come already shows it: a wrong length must not swallow a second of
                // beams first.
                let payload = header.0.get(..length);
                let Some(next) = find_signature(payload.unwrap_or(header.0)) else {
                    payload?;
                    break (version, kind, length);
                };
                self.faults.cut += 1;
                self.pass_over(HEADER_BYTES + next);
                continue;
            }
            // Its length is wrong: a good message may begin anywhere behind the signature.
            self.pass_over(SIGNATURE.len());
        };
        let begin = self.begin + HEADER_BYTES;
        self.begin = begin + length;
        let payload = self.buffer.get(begin..self.begin)?;
        Some(Frame {
            version,
            kind,
            payload,
        })
    }

    /// Forgets what is half read.
    pub fn restart(&mut self) {
        self.buffer.clear();
        self.begin = 0;
    }

    /// What was passed over so far.
    pub fn faults(&self) -> FrameFaults {
        self.faults
    }

    fn rest(&self) -> &[u8] {
        self.buffer.get(self.begin..).unwrap_or_default()
    }

    /// Moves to the first signature, or to what may become one when more has come.
    fn skip_junk(&mut self) {
        let rest = self.rest();
        let may_begin = |at: usize| {
            let tail = rest.get(at..).unwrap_or_default();
            let known = tail.len().min(SIGNATURE.len());
            tail.get(..known) == SIGNATURE.get(..known)
        };
        let junk = (0..rest.len())
            .find(|at| may_begin(*at))
            .unwrap_or(rest.len());
        self.pass_over(junk);
    }

    fn pass_over(&mut self, junk: usize) {
        self.faults.junk_bytes += junk as u64;
        self.begin += junk;
    }
}

/// Where a message begins inside another one's body. Its last byte is sought first: it is rare in
/// powers.
fn find_signature(payload: &[u8]) -> Option<usize> {
    // The fast way out of most bodies.
    if !payload.contains(&0xfe) {
        return None;
    }
    let mut behind = 0;
    while let Some(at) = payload.get(behind..)?.iter().position(|byte| *byte == 0xfe) {
        behind += at + 1;
        let begin = behind.checked_sub(SIGNATURE.len());
        if begin.is_some_and(|begin| payload.get(begin..behind) == Some(&SIGNATURE)) {
            return begin;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// IASDK, network unit tests, `header_only` of `GivenAColossusMessage`: a configuration of two
    /// bytes.
    const VENDOR_HEADER_ONLY: [u8; 24] = [
        0x00, 0x01, 0x03, 0x03, 0x07, 0x07, 0x0F, 0x0F, 0x1F, 0x1F, 0x3F, 0x3F, 0x7F, 0x7F, 0xFE,
        0xFE, 1, 10, 0, 0, 0, 2, 0xCA, 0xFE,
    ];
    /// The same, `message`: its signature is broken.
    const VENDOR_BROKEN: [u8; 32] = [
        0x00, 0x01, 0x03, 0x03, 0x09, 0x09, 0x0F, 0x0F, 0x1F, 0x1F, 0x6F, 0x6F, 0x8F, 0x8F, 0xFE,
        0xFE, 10, 0, 0, 0, 11, b'+', b'+', b'M', b'e', b's', b's', b'a', b'g', b'e', b'+', b'+',
    ];
    /// IASDK, pythonexamples/ReadOneSingleAzimuthOfFFTData.py, `start_fft_data`: version 0 before
    /// anything was heard.
    const VENDOR_START_FFT: [u8; 22] = *b"\x00\x01\x03\x03\x07\x07\x0f\x0f\x1f\x1f\x3f\x3f\x7f\x7f\xfe\xfe\x00\x15\x00\x00\x00\x00";

    fn all(parser: &mut FrameParser) -> Vec<(u8, Vec<u8>)> {
        std::iter::from_fn(|| parser.next().map(|f| (f.kind, f.payload.to_vec()))).collect()
    }

    #[test]
    fn vendor_vectors_both_ways() {
        let mut parser = FrameParser::default();
        parser.push(&VENDOR_BROKEN);
        parser.push(&VENDOR_HEADER_ONLY);
        parser.push(&VENDOR_START_FFT);
        assert_eq!(
            all(&mut parser),
            [
                (kind::CONFIGURATION, vec![0xCA, 0xFE]),
                (kind::START_FFT, vec![])
            ]
        );
        assert_eq!(parser.faults().junk_bytes, 32);
        let mut bytes = Vec::new();
        let payload = &[0xCA, 0xFE];
        Frame {
            version: 1,
            kind: kind::CONFIGURATION,
            payload,
        }
        .encode(&mut bytes);
        assert_eq!(bytes, VENDOR_HEADER_ONLY);
        bytes.clear();
        command(0, kind::START_FFT, &mut bytes);
        assert_eq!(bytes, VENDOR_START_FFT);
    }

    #[test]
    fn what_is_implausible_is_counted_and_the_next_message_found() {
        let mut bytes = Vec::new();
        command(2, kind::KEEP_ALIVE, &mut bytes);
        command(1, kind::KEEP_ALIVE, &mut bytes);
        bytes.extend_from_slice(&SIGNATURE);
        bytes.extend_from_slice(&[1, kind::FFT_8, 0, 0x10, 0, 1]);
        command(1, kind::HEALTH, &mut bytes);
        let mut parser = FrameParser::default();
        parser.push(&bytes);
        assert_eq!(
            all(&mut parser),
            [(kind::KEEP_ALIVE, vec![]), (kind::HEALTH, vec![])]
        );
        let faults = parser.faults();
        assert_eq!(
            (faults.versions, faults.oversize, faults.junk_bytes),
            (1, 1, 44)
        );
    }

    #[test]
    fn a_message_that_is_cut_does_not_take_the_next_one_with_it() {
        let message = |kind| {
            let mut bytes = Vec::new();
            let payload = &[7; 100];
            Frame {
                version: 1,
                kind,
                payload,
            }
            .encode(&mut bytes);
            bytes
        };
        let mut parser = FrameParser::default();
        parser.push(&message(kind::FFT_8)[..60]);
        parser.push(&message(kind::FFT_16));
        assert_eq!(all(&mut parser), [(kind::FFT_16, vec![7; 100])]);
        let faults = parser.faults();
        assert_eq!((faults.cut, faults.junk_bytes), (1, 60));
    }

    #[test]
    fn a_length_that_is_wrong_costs_no_more_than_its_own_message() {
        let mut parser = FrameParser::default();
        let mut bytes = SIGNATURE.to_vec();
        // A mebibyte, which never comes.
        bytes.extend_from_slice(&[1, kind::FFT_8, 0, 0x10, 0, 0]);
        bytes.extend_from_slice(&[7; 50]);
        parser.push(&bytes);
        assert_eq!(parser.next(), None);
        parser.push(&VENDOR_HEADER_ONLY);
        assert_eq!(all(&mut parser), [(kind::CONFIGURATION, vec![0xCA, 0xFE])]);
    }

    proptest! {
        /// However the stream is cut, and whatever junk stands between: every message comes out
        /// once.
        #[test]
        fn cuts_and_junk_do_not_matter(
            messages in prop::collection::vec((any::<u8>(), prop::collection::vec(any::<u8>(), 0..60)), 1..8),
            junk in prop::collection::vec(1..0xff_u8, 0..40),
            cut in 1..50_usize,
        ) {
            let mut bytes = Vec::new();
            for (kind, payload) in &messages {
                bytes.extend_from_slice(&junk);
                Frame { version: 1, kind: *kind, payload }.encode(&mut bytes);
            }
            let mut parser = FrameParser::default();
            let mut out = Vec::new();
            for piece in bytes.chunks(cut) {
                parser.push(piece);
                out.extend(all(&mut parser));
            }
            prop_assert_eq!(out, messages.clone());
            prop_assert_eq!(parser.faults().junk_bytes, (junk.len() * messages.len()) as u64);
        }

        #[test]
        fn no_bytes_break_it(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut parser = FrameParser::default();
            parser.push(&SIGNATURE);
            parser.push(&bytes);
            while parser.next().is_some() {}
        }
    }
}
