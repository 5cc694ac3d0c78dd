//! The checksums of a file as a whole: chunks have their own, which every reader checks.

use mcap::records::op;
use std::io::{self, Read};

/// Opcode and length.
const FRAME: u64 = 9;
/// Summary's start, offsets' start, checksum.
const FOOTER: usize = 20;
/// Read at once.
const BLOCK: usize = 1 << 16;

/// Reads a file from its beginning to its end and lists what is wrong: the checksums of the data
/// and of the summary, the end. The list is empty where nothing is; a log that was never finished
/// has none of them, which is listed.
pub fn check_sums(source: impl Read) -> io::Result<Vec<String>> {
    let mut file = Summed {
        source,
        at: 0,
        sum: crc32fast::Hasher::new(),
    };
    let mut wrong = Vec::new();
    let mut magic = [0; mcap::MAGIC.len()];
    if file.fill(&mut magic)? < magic.len() || magic != mcap::MAGIC {
        return Ok(vec!["offset 0: not MCAP".to_owned()]);
    }
    // The data section: whole records up to its end record.
    let data = loop {
        let (at, before) = (file.at, file.sum.clone());
        let Some((opcode, length)) = file.frame()? else {
            let end = format!("offset {at}: the file ends before its data do");
            return Ok(vec![end]);
        };
        if opcode == op::DATA_END && length == 4 {
            break before.finalize();
        }
        if !file.skip(length)? {
            let cut = format!("offset {at}: a record is longer than the file");
            return Ok(vec![cut]);
        }
    };
    let mut stored = [0; 4];
    file.fill(&mut stored)?;
    let stored = u32::from_le_bytes(stored);
    // 0: its writer did not compute it.
    if stored != 0 && stored != data {
        wrong.push(format!("data: checksum {data:08x}, stored {stored:08x}"));
    }
    let begin = file.at;
    let mut rest = Vec::new();
    file.source.read_to_end(&mut rest)?;
    wrong.extend(check_end(&rest, begin));
    Ok(wrong)
}

/// The summary, the footer and the magic at the end.
fn check_end(rest: &[u8], begin: u64) -> Option<String> {
    let Some(rest) = rest.strip_suffix(mcap::MAGIC) else {
        return Some("the end: no magic".to_owned());
    };
    let split = rest.len().checked_sub(FRAME as usize + FOOTER)?;
    let (_, footer) = rest.split_at_checked(split)?;
    let is_footer = footer.first() == Some(&op::FOOTER)
        && footer.get(1..9) == Some((FOOTER as u64).to_le_bytes().as_slice());
    if !is_footer {
        return Some("the end: no footer".to_owned());
    }
    let start = u64::from_le_bytes(*footer.get(FRAME as usize..)?.first_chunk()?);
    let summary = match start {
        0 => Some(split),
        start => (start.checked_sub(begin)).and_then(|start| usize::try_from(start).ok()),
    };
    let summed = summary.and_then(|summary| rest.get(summary..rest.len() - 4));
    let stored = u32::from_le_bytes(*rest.last_chunk()?);
    match summed.map(crc32fast::hash) {
        Some(found) if stored == 0 || found == stored => None,
        Some(found) => Some(format!(
            "summary: checksum {found:08x}, stored {stored:08x}"
        )),
        None => Some("summary: does not begin between the data and the end".to_owned()),
    }
}

/// A source, how far it is read, and the checksum of that.
struct Summed<R> {
    source: R,
    at: u64,
    sum: crc32fast::Hasher,
}

impl<R: Read> Summed<R> {
    /// Fills as much as there is.
    fn fill(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while let Some(rest) = into.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match self.source.read(rest)? {
                0 => break,
                count => filled += count,
            }
        }
        self.sum.update(into.get(..filled).unwrap_or_default());
        self.at += filled as u64;
        Ok(filled)
    }

    /// The next record's opcode and length; `None` where the file ends.
    fn frame(&mut self) -> io::Result<Option<(u8, u64)>> {
        let mut frame = [0; FRAME as usize];
        if self.fill(&mut frame)? < frame.len() {
            return Ok(None);
        }
        let [opcode, length @ ..] = frame;
        Ok(Some((opcode, u64::from_le_bytes(length))))
    }

    /// Passes over that many bytes; false where there are fewer.
    fn skip(&mut self, mut length: u64) -> io::Result<bool> {
        let mut block = [0; BLOCK];
        while length > 0 {
            let wanted = length.min(BLOCK as u64) as usize;
            let block = block.get_mut(..wanted).unwrap_or_default();
            if self.fill(block)? < wanted {
                return Ok(false);
            }
            length -= wanted as u64;
        }
        Ok(true)
    }
}
