//! One chunk of a log: its records, decompressed and checked before the first is given out.

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult};

/// The largest record or chunk that is accepted, compressed or not. Ours have about 1 MiB; the
/// largest message has 0.8 MB. It bounds what a hostile length can make us allocate.
pub(crate) const SIZE_MAX: usize = 256 << 20;

/// Bytes of a record before its content: opcode and length.
pub(crate) const FRAME: usize = 9;

// Offsets in a chunk's record, frame included: start and end time, then these (MCAP, op 0x06).
const UNCOMPRESSED_SIZE: usize = FRAME + 16;
const CRC: usize = FRAME + 24;
const COMPRESSION: usize = FRAME + 28;

/// The records of one chunk.
pub(crate) struct Chunk {
    reader: LinearReader,
    // The chunk's record with its frame, as in the file.
    input: Vec<u8>,
    fed: usize,
    cut: bool,
}

impl Chunk {
    /// A chunk from its record with the frame. A `cut` one gives the records before the cut,
    /// unchecked.
    pub(crate) fn new(mut input: Vec<u8>, cut: bool) -> McapResult<Self> {
        let header = header_size(&input).ok_or(McapError::UnexpectedEoc)?;
        let available = (input.len() - header) as u64;
        if cut {
            let length = (input.len() - FRAME) as u64;
            put(&mut input, 1, &length.to_le_bytes());
            put(&mut input, UNCOMPRESSED_SIZE, &u64::MAX.to_le_bytes());
            put(&mut input, CRC, &0_u32.to_le_bytes());
            put(&mut input, header - 8, &available.to_le_bytes());
        }
        let compressed = u64_at(&input, header - 8).unwrap_or(u64::MAX);
        // mcap 0.26 counts below zero where a record of an uncompressed chunk runs into what
        // follows.
        if compressed != available {
            return Err(McapError::BadChunkLength {
                header: compressed,
                available,
            });
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(SIZE_MAX);
        let reader = LinearReader::new_with_options(options);
        Ok(Self {
            reader,
            input,
            fed: 0,
            cut,
        })
    }

    /// Copies the next record's content to `record` and gives its opcode; `None` at the end.
    pub(crate) fn next_record(&mut self, record: &mut Vec<u8>) -> McapResult<Option<u8>> {
        while let Some(event) = self.reader.next_event() {
            match event {
                // Where less is left than it asks for, it gets what is left, and knows that this
                // is the end.
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    let rest = self.input.get(self.fed..).unwrap_or_default();
                    let next = rest.get(..wanted).unwrap_or(rest);
                    self.reader.insert(next.len()).copy_from_slice(next);
                    self.reader.notify_read(next.len());
                    self.fed += next.len();
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    record.clear();
                    record.extend_from_slice(data);
                    return Ok(Some(opcode));
                }
                Err(_) if self.cut => return Ok(None),
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// Whether the file ends inside it.
    pub(crate) fn is_cut(&self) -> bool {
        self.cut
    }

    /// The chunk's memory, for the next one.
    pub(crate) fn into_memory(self) -> Vec<u8> {
        self.input
    }
}

/// Bytes before the compressed records.
fn header_size(record: &[u8]) -> Option<usize> {
    let name = u32_at(record, COMPRESSION)? as usize;
    let size = name.checked_add(COMPRESSION + 4 + 8)?;
    (size <= record.len()).then_some(size)
}

/// Whether a chunk's record can begin here: used to find the next one behind damage.
pub(crate) fn is_chunk_start(bytes: &[u8]) -> bool {
    let name = |name: &[u8]| {
        let size = COMPRESSION + 4 + name.len() + 8;
        u32_at(bytes, COMPRESSION) == Some(name.len() as u32)
            && bytes
                .get(COMPRESSION + 4..)
                .is_some_and(|rest| rest.starts_with(name))
            && u64_at(bytes, size - 8).and_then(|data| data.checked_add((size - FRAME) as u64))
                == u64_at(bytes, 1)
    };
    bytes.first() == Some(&op::CHUNK) && (name(b"lz4") || name(b"zstd") || name(b""))
}

/// Bytes that [`is_chunk_start`] needs.
pub(crate) const START_BYTES: usize = COMPRESSION + 4 + 4 + 8;

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(field) = bytes.get_mut(at..at + value.len()) {
        field.copy_from_slice(value);
    }
}
