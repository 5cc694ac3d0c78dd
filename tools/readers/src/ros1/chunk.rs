//! Chunks of a ROS 1 bag: where one begins, and what is inside, whatever its compression.

use super::record::Fields;
use std::io::{BufReader, Read, Take};

/// Largest plausible decompressed chunk, bytes. rosbag writes 768 KiB, or one message where that
/// is more; the largest in common recordings, a raw camera image, is about 30 MB.
const CHUNK_MAX: u64 = 256 << 20;

/// Longest header of a chunk record: three short fields.
const CHUNK_HEADER_MAX: usize = 128;

/// Compression of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Bz2,
    Lz4,
}

/// The header of a chunk record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChunkHeader {
    pub compression: Compression,
    /// Bytes after decompression.
    pub size: u64,
}

impl ChunkHeader {
    pub fn from_fields(fields: &Fields) -> Option<Self> {
        let compression = match fields.get("compression")? {
            b"none" => Compression::None,
            b"bz2" => Compression::Bz2,
            b"lz4" => Compression::Lz4,
            _ => return None,
        };
        let size = u64::from(fields.u32("size")?);
        (size <= CHUNK_MAX).then_some(Self { compression, size })
    }

    /// Appends the chunk's content to `out`; what came before a damage is there also when it
    /// fails.
    pub fn decompress(
        self,
        stored: Take<&mut impl Read>,
        out: &mut Vec<u8>,
    ) -> std::io::Result<()> {
        // One byte more than promised, to see a chunk that holds more.
        let limit = self.size + 1;
        let read = match self.compression {
            Compression::None => stored.take(limit).read_to_end(out)?,
            Compression::Bz2 => bzip2::read::BzDecoder::new(BufReader::new(stored))
                .take(limit)
                .read_to_end(out)?,
            Compression::Lz4 => lz4_flex::frame::FrameDecoder::new(BufReader::new(stored))
                .take(limit)
                .read_to_end(out)?,
        };
        if read as u64 == self.size {
            Ok(())
        } else {
            Err(std::io::Error::new(
                std::io::ErrorKind::InvalidData,
                format!("{read} bytes after decompression, {} promised", self.size),
            ))
        }
    }
}

/// Offset of the first chunk record that begins in `window`.
pub(super) fn find(window: &[u8]) -> Option<usize> {
    /// The field that every chunk's header has, with its length.
    const OP: &[u8] = b"\x04\0\0\0op=\x05";
    let mut from = 0;
    while let Some(found) = window.get(from..)?.windows(OP.len()).position(|w| w == OP) {
        let op = from + found;
        for start in op.saturating_sub(CHUNK_HEADER_MAX)..op.saturating_sub(3) {
            let header = window.get(start..).and_then(super::record::counted);
            let Some((header, _)) = header.filter(|(h, _)| h.len() <= CHUNK_HEADER_MAX) else {
                continue;
            };
            if let Some(fields) = Fields::parse(header)
                && ChunkHeader::from_fields(&fields).is_some()
            {
                return Some(start);
            }
        }
        from = op + 1;
    }
    None
}
