//! The beginning of a journal: what it is, and what its keyframes and its map were made under.

use super::Error;
use super::pack::Unpacker;
use crate::mapper::fingerprint;
use randt_config::Config;
use randt_messages::{Keyframe, Topic};

/// First bytes of every journal.
pub const MAGIC: [u8; 8] = *b"RANDTMAP";
/// Of header, records and packing.
const VERSION: u32 = 1;
/// Layout that keyframes had before they carried how they were judged: such journals are read, and
/// go on.
const FORMER_LAYOUT: &str = "Keyframe-5c671b506cf875de";
/// A longer name of a layout is damage.
const NAME_BYTES_MAX: u32 = 256;

/// The header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Fingerprint of what the map is computed by, as the journal was begun.
    pub config: u64,
}

impl Header {
    /// The header of a journal that begins now.
    pub fn new(config: &Config) -> Self {
        Self {
            config: fingerprint(config),
        }
    }

    /// Appends it: magic, version, configuration, layout of the keyframe message, checksum.
    pub(super) fn append(&self, out: &mut Vec<u8>) {
        let layout = Keyframe::TYPE_NAME;
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&self.config.to_le_bytes());
        bytes.extend_from_slice(&(layout.len() as u32).to_le_bytes());
        bytes.extend_from_slice(layout.as_bytes());
        bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
        out.append(&mut bytes);
    }

    /// Reads it and how many bytes it takes.
    pub(super) fn read(bytes: &[u8]) -> Result<(Self, usize), Error> {
        let mut rest = Unpacker(bytes);
        let cut = || Error::HeaderCut(bytes.len());
        let magic = rest.array().ok_or_else(cut)?;
        if magic != MAGIC {
            return Err(Error::NotAJournal(magic));
        }
        let found = u32::from_le_bytes(rest.array().ok_or_else(cut)?);
        if found != VERSION {
            let expected = VERSION;
            return Err(Error::Version { found, expected });
        }
        let config = u64::from_le_bytes(rest.array().ok_or_else(cut)?);
        let length = u32::from_le_bytes(rest.array().ok_or_else(cut)?);
        if length > NAME_BYTES_MAX {
            return Err(Error::HeaderDamaged);
        }
        let layout = rest.bytes(length as usize).ok_or_else(cut)?;
        let before = bytes.len() - rest.0.len();
        let checksum = u32::from_le_bytes(rest.array().ok_or_else(cut)?);
        if checksum != crc32fast::hash(bytes.get(..before).unwrap_or_default()) {
            return Err(Error::HeaderDamaged);
        }
        let known = [Keyframe::TYPE_NAME, FORMER_LAYOUT];
        if !known.iter().any(|known| layout == known.as_bytes()) {
            return Err(Error::Layout {
                found: String::from_utf8_lossy(layout).into_owned(),
                expected: Keyframe::TYPE_NAME,
            });
        }
        Ok((Self { config }, bytes.len() - rest.0.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_read_and_what_is_none_is_refused() {
        let header = Header::new(&Config::default());
        let mut bytes = Vec::new();
        header.append(&mut bytes);
        let end = bytes.len();
        assert_eq!(Header::read(&bytes).unwrap(), (header, end));
        for cut in 0..end {
            let error = Header::read(&bytes[..cut]).unwrap_err();
            assert!(matches!(error, Error::HeaderCut { .. }), "{cut}: {error}");
        }
        for at in 0..end {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << bit;
                assert!(Header::read(&flipped).is_err(), "{at} {bit}");
            }
        }
    }

    #[test]
    fn another_layout_is_named() {
        let mut bytes = Vec::new();
        Header { config: 7 }.append(&mut bytes);
        let end = bytes.len();
        bytes[end - 5] ^= 1;
        let checksum = crc32fast::hash(&bytes[..end - 4]);
        bytes[end - 4..].copy_from_slice(&checksum.to_le_bytes());
        let text = Header::read(&bytes).unwrap_err().to_string();
        assert!(text.contains(Keyframe::TYPE_NAME), "{text}");
    }
}
