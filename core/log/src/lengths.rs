//! Whether the lengths inside a record lie within it.
//!
//! mcap's parser reserves memory for a text before it checks that the text is there: one damaged
//! byte can ask for 4 GiB, which a small machine refuses by ending the process.

use mcap::records::op;

/// A segment of a record's content (MCAP, "Records").
#[derive(Clone, Copy, Debug)]
enum Segment {
    /// That many bytes of numbers.
    Fixed(usize),
    /// Bytes behind their length: a text, data, a map of numbers.
    Counted,
    /// Pairs of texts behind the length of all of them.
    Texts,
}
use Segment::{Counted, Fixed, Texts};

/// The segments of a record up to its last length.
fn segments(opcode: u8) -> &'static [Segment] {
    match opcode {
        op::HEADER => &[Counted, Counted],
        op::SCHEMA => &[Fixed(2), Counted, Counted, Counted],
        op::CHANNEL => &[Fixed(4), Counted, Counted, Texts],
        op::CHUNK_INDEX => &[Fixed(32), Counted, Fixed(8), Counted],
        op::ATTACHMENT_INDEX => &[Fixed(40), Counted, Counted],
        op::STATISTICS => &[Fixed(42), Counted],
        op::METADATA => &[Counted, Texts],
        op::METADATA_INDEX => &[Fixed(16), Counted],
        _ => &[],
    }
}

/// Whether mcap's parser may see this record's content. Not for chunks and attachments.
pub fn lengths_fit(opcode: u8, content: &[u8]) -> bool {
    let mut rest = content;
    segments(opcode).iter().all(|segment| {
        let split = match segment {
            Fixed(size) => rest.split_at_checked(*size),
            Counted | Texts => counted(rest),
        };
        let Some((inside, behind)) = split else {
            return false;
        };
        rest = behind;
        !matches!(segment, Texts) || are_texts(inside)
    })
}

fn counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

fn are_texts(mut bytes: &[u8]) -> bool {
    while !bytes.is_empty() {
        match counted(bytes) {
            Some((_, rest)) => bytes = rest,
            None => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LogWriter, Options};
    use std::io::Cursor;

    /// Opcode and content of every record outside chunks of a small log.
    fn records() -> Vec<(u8, Vec<u8>)> {
        let sink = Cursor::new(Vec::new());
        let mut writer = LogWriter::new(sink, "x", Options::default()).unwrap();
        let pairs = [("radar", "front"), ("imu", "")];
        let pairs = pairs.map(|(key, value)| (key.to_owned(), value.to_owned()));
        writer.write_metadata("robot", pairs.into()).unwrap();
        let sample = randt_messages::Message::<randt_messages::ImuSampleTopic>::default();
        writer.write(sample.as_ref()).unwrap();
        let log = writer.finish().unwrap().into_inner();
        let mut rest = &log[mcap::MAGIC.len()..log.len() - mcap::MAGIC.len()];
        let mut records = Vec::new();
        while let Some((opcode, behind)) = rest.split_first() {
            let (length, behind) = behind.split_first_chunk::<8>().unwrap();
            let (content, behind) = behind.split_at(u64::from_le_bytes(*length) as usize);
            records.push((*opcode, content.to_vec()));
            rest = behind;
        }
        records
    }

    #[test]
    fn what_mcap_writes_fits_and_no_beginning_of_it_does() {
        let mut known = Vec::new();
        for (opcode, content) in records() {
            assert!(lengths_fit(opcode, &content), "{opcode:#x}");
            if segments(opcode).is_empty() {
                continue;
            }
            known.push(opcode);
            // A chunk index ends with numbers behind its last length.
            let tail = if opcode == op::CHUNK_INDEX { 16 } else { 0 };
            for length in 0..content.len() - tail {
                assert!(
                    !lengths_fit(opcode, &content[..length]),
                    "{opcode:#x} {length}"
                );
            }
        }
        for opcode in [
            op::HEADER,
            op::METADATA,
            op::CHUNK_INDEX,
            op::STATISTICS,
            op::CHANNEL,
        ] {
            assert!(known.contains(&opcode), "{opcode:#x}");
        }
    }

    #[test]
    fn a_length_beyond_the_record_does_not_fit() {
        assert!(lengths_fit(op::HEADER, b"\0\0\0\0\x01\0\0\0x"));
        assert!(!lengths_fit(op::HEADER, b"\0\0\0\0\xff\xff\xff\xffx"));
        // A pair of texts whose second is longer than the map.
        assert!(!lengths_fit(
            op::METADATA,
            b"\0\0\0\0\x09\0\0\0\x01\0\0\0a\xff\0\0\0"
        ));
    }
}
