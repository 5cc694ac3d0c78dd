//! Records: kind, length, checksum, payload. A record is there whole or it is not there.

use super::pack::Unpacker;

/// Bytes before the payload: kind, length, checksum of both and of the payload; least byte first.
const HEAD_BYTES: usize = 12;
/// A larger record is damage: a snapshot of 200,000 keyframes; the largest keyframe has one
/// megabyte.
const PAYLOAD_BYTES_MAX: u32 = 1 << 26;
/// Offsets behind a damage that are tried for a whole record; bytes made for it could ask for any
/// number.
const TRIES_MAX: usize = 64;

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A keyframe that the mapper has taken.
    Keyframe,
    /// What the mapper had made of the keyframes before.
    Snapshot,
}

impl Kind {
    const ALL: [Self; 2] = [Self::Keyframe, Self::Snapshot];

    /// Its name in the bytes.
    fn mark(self) -> [u8; 4] {
        match self {
            Self::Keyframe => *b"KEYF",
            Self::Snapshot => *b"SNAP",
        }
    }
}

/// A record in the bytes of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// What it holds.
    pub kind: Kind,
    /// Packed.
    pub payload: &'a [u8],
}

/// Where a journal stops making sense.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Offset of the first byte that is no good.
    pub offset: usize,
    /// What is wrong there.
    pub what: &'static str,
    /// Whether whole records follow: then it is no write that a power cut broke off.
    pub in_the_middle: bool,
}

/// Appends a record whose payload `fill` writes; nothing where that is too large.
pub(super) fn append(kind: Kind, out: &mut Vec<u8>, fill: impl FnOnce(&mut Vec<u8>)) -> bool {
    let start = out.len();
    out.extend_from_slice(&kind.mark());
    out.extend_from_slice(&[0; HEAD_BYTES - 4]);
    fill(out);
    let (head, payload) = out.split_at_mut(start + HEAD_BYTES);
    let length = u32::try_from(payload.len()).unwrap_or(u32::MAX);
    if length > PAYLOAD_BYTES_MAX {
        out.truncate(start);
        return false;
    }
    let checksum = checksum(kind.mark(), length, payload);
    let numbers = length.to_le_bytes().into_iter().chain(checksum);
    let heads = head.iter_mut().skip(start + 4);
    heads.zip(numbers).for_each(|(to, byte)| *to = byte);
    true
}

/// The records of a journal up to the first that is not whole.
#[derive(Clone, Debug)]
pub struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
    damage: Option<Damage>,
}

impl<'a> Records<'a> {
    /// From an offset on.
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self {
            bytes,
            at,
            damage: None,
        }
    }

    /// Those of one kind.
    pub fn of_kind(self, kind: Kind) -> impl Iterator<Item = Record<'a>> {
        self.filter(move |record| record.kind == kind)
    }

    /// How many bytes are good so far: header and whole records.
    pub fn good(&self) -> usize {
        self.at
    }

    /// What ended the walk, where that was not the end.
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        if rest.is_empty() || self.damage.is_some() {
            return None;
        }
        match first(rest) {
            Ok(record) => {
                self.at += HEAD_BYTES + record.payload.len();
                Some(record)
            }
            Err(what) => {
                self.damage = Some(Damage {
                    offset: self.at,
                    what,
                    in_the_middle: is_followed(rest),
                });
                None
            }
        }
    }
}

/// The record at the front.
fn first(bytes: &[u8]) -> Result<Record<'_>, &'static str> {
    let mut rest = Unpacker(bytes);
    let cut = "the record is cut off";
    let mark: [u8; 4] = rest.array().ok_or(cut)?;
    let kind = Kind::ALL.into_iter().find(|kind| kind.mark() == mark);
    let kind = kind.ok_or("no record begins here")?;
    let length = u32::from_le_bytes(rest.array().ok_or(cut)?);
    if length > PAYLOAD_BYTES_MAX {
        return Err("the record is longer than any");
    }
    let found = rest.array().ok_or(cut)?;
    let payload = rest.bytes(length as usize).ok_or(cut)?;
    if found != checksum(mark, length, payload) {
        return Err("the record's checksum is wrong");
    }
    Ok(Record { kind, payload })
}

/// Whether a whole record begins anywhere behind the first byte.
fn is_followed(bytes: &[u8]) -> bool {
    let starts = (1..bytes.len()).filter_map(|at| bytes.get(at..));
    let marked = starts.filter(|rest| Kind::ALL.iter().any(|kind| rest.starts_with(&kind.mark())));
    marked.take(TRIES_MAX).any(|rest| first(rest).is_ok())
}

fn checksum(mark: [u8; 4], length: u32, payload: &[u8]) -> [u8; 4] {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&mark);
    hasher.update(&length.to_le_bytes());
    hasher.update(payload);
    hasher.finalize().to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn journal(payloads: &[&[u8]]) -> Vec<u8> {
        let mut bytes = b"head".to_vec();
        for (payload, kind) in payloads.iter().zip(Kind::ALL.into_iter().cycle()) {
            assert!(append(kind, &mut bytes, |out| out.extend_from_slice(payload)));
        }
        bytes
    }

    fn walk(bytes: &[u8]) -> (Vec<&[u8]>, usize, Option<Damage>) {
        let mut records = Records::new(bytes, 4);
        let payloads = records.by_ref().map(|record| record.payload).collect();
        (payloads, records.good(), records.damage().cloned())
    }

    #[test]
    fn a_cut_leaves_the_whole_records_before_it() {
        let payloads: [&[u8]; 4] = [b"one", b"", b"KEYF and SNAP", b"four"];
        let bytes = journal(&payloads);
        let ends = [4, 19, 31, 56, 72];
        for end in 4..=bytes.len() {
            let (found, good, damage) = walk(&bytes[..end]);
            let whole = ends.iter().filter(|at| **at <= end).count() - 1;
            assert_eq!(found, payloads[..whole], "{end}");
            assert_eq!(good, ends[whole]);
            // Cut at a record's end it is not damaged; anywhere else nothing follows.
            assert_eq!(damage.is_some(), end != good);
            assert!(damage.is_none_or(|damage| damage.offset == good && !damage.in_the_middle));
        }
    }

    #[test]
    fn a_power_cut_differs_from_damage_in_the_middle() {
        let bytes = journal(&[b"one", b"two", b"three"]);
        let mut zeros = bytes[..36].to_vec();
        zeros.resize(100, 0);
        let (found, good, damage) = walk(&zeros);
        assert_eq!((found.len(), good), (2, 34));
        assert!(!damage.unwrap().in_the_middle);
        let mut flipped = bytes;
        flipped[20] ^= 1;
        let (found, good, damage) = walk(&flipped);
        assert_eq!((found.len(), good), (1, 19));
        assert!(damage.unwrap().in_the_middle);
    }

    proptest! {
        #[test]
        fn a_flipped_bit_is_found(at in 4..48_usize, bit in 0..8_u8) {
            let mut bytes = journal(&[b"one", b"two", b"three"]);
            prop_assert_eq!(bytes.len(), 51);
            bytes[at] ^= 1 << bit;
            let (found, good, damage) = walk(&bytes);
            prop_assert!(damage.is_some() && good <= at && found.len() < 3);
        }

        #[test]
        fn hostile_bytes_are_walked(mut bytes: Vec<u8>) {
            bytes.splice(0..0, *b"headKEYF");
            walk(&bytes);
        }
    }

    #[test]
    fn marks_without_end_cost_no_more_than_others() {
        let bytes = b"headKEYF\xff\xff\xff\x00".repeat(100_000);
        let (found, good, damage) = walk(&bytes);
        assert!(found.is_empty() && good == 4 && !damage.unwrap().in_the_middle);
    }
}
