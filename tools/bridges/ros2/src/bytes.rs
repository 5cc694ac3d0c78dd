//! Messages of DDS as bytes: what they hold is written and read elsewhere.

use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use std::convert::Infallible;

/// Bytes that name the kind of CDR before a message.
const HEADER_BYTES: usize = 4;
/// Both byte orders of plain CDR.
const ENCODINGS: [RepresentationIdentifier; 2] = [
    RepresentationIdentifier::CDR_LE,
    RepresentationIdentifier::CDR_BE,
];

/// Passes messages on as they are.
#[derive(Clone, Copy, Debug)]
pub struct AsBytes;

/// A message behind its header, which RustDDS writes itself.
pub fn without_header(message: Vec<u8>) -> Bytes {
    let mut bytes = Bytes::from(message);
    bytes.split_off(HEADER_BYTES.min(bytes.len()))
}

impl SerializerAdapter<Bytes> for AsBytes {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Bytes) -> Result<Bytes, Infallible> {
        Ok(value.clone())
    }
}

impl DeserializerAdapter<Vec<u8>> for AsBytes {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &ENCODINGS
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for AsBytes {
    type Decoder = Self;
    const DECODER: Self = Self;
}

impl Decode<'_, Vec<u8>> for AsBytes {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Vec<u8>, Infallible> {
        let is_little = encoding == RepresentationIdentifier::CDR_LE;
        let mut message = Vec::with_capacity(HEADER_BYTES + bytes.len());
        message.extend([0, u8::from(is_little), 0, 0]);
        message.extend(bytes);
        Ok(message)
    }
}
