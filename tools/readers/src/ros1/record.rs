//! The record of a ROS 1 bag: a header of named fields, then data, each behind its length.

/// Longest plausible header. The longest in use, a connection's, is about its topic's length.
pub(super) const HEADER_MAX: usize = 1 << 16;

/// What a record is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Op {
    Message,
    BagHeader,
    Index,
    Chunk,
    ChunkInfo,
    Connection,
}

/// The fields of a record's header; they are known to fill it exactly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a>(&'a [u8]);

/// A record that lies whole in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a> {
    pub fields: Fields<'a>,
    pub data: &'a [u8],
    /// Bytes from the record's beginning to the next one's.
    pub length: usize,
}

/// Splits bytes behind a little-endian length from the rest.
pub(super) fn counted(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

impl<'a> Fields<'a> {
    /// `None` where the bytes are no sequence of `name=value`.
    pub fn parse(header: &'a [u8]) -> Option<Self> {
        let mut rest = header;
        while !rest.is_empty() {
            let (field, next) = counted(rest)?;
            field
                .iter()
                .position(|byte| *byte == b'=')
                .filter(|at| *at > 0)?;
            rest = next;
        }
        Some(Self(header))
    }

    pub fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((field, next)) = counted(rest) {
            if let Some(value) = field.strip_prefix(name.as_bytes())
                && let Some(value) = value.strip_prefix(b"=")
            {
                return Some(value);
            }
            rest = next;
        }
        None
    }

    pub fn text(&self, name: &str) -> Option<String> {
        Some(String::from_utf8_lossy(self.get(name)?).into_owned())
    }

    pub fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    pub fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    /// A ROS time as nanoseconds.
    pub fn time_ns(&self, name: &str) -> Option<i64> {
        let (seconds, nanoseconds) = self.get(name)?.split_first_chunk::<4>()?;
        let nanoseconds: [u8; 4] = nanoseconds.try_into().ok()?;
        let seconds = i64::from(u32::from_le_bytes(*seconds));
        Some(seconds * 1_000_000_000 + i64::from(u32::from_le_bytes(nanoseconds)))
    }

    pub fn op(&self) -> Option<Op> {
        match self.get("op")? {
            [2] => Some(Op::Message),
            [3] => Some(Op::BagHeader),
            [4] => Some(Op::Index),
            [5] => Some(Op::Chunk),
            [6] => Some(Op::ChunkInfo),
            [7] => Some(Op::Connection),
            _ => None,
        }
    }
}

impl<'a> Record<'a> {
    /// The record at the beginning of `bytes`; `None` where there is no whole one.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        let (header, rest) = counted(bytes)?;
        let fields = (header.len() <= HEADER_MAX).then(|| Fields::parse(header))??;
        let (data, rest) = counted(rest)?;
        Some(Self {
            fields,
            data,
            length: bytes.len() - rest.len(),
        })
    }
}

/// Connection header: topic and type of the messages with its number.
pub(super) fn connection(fields: &Fields, data: &[u8]) -> Option<(u32, String, String)> {
    let number = fields.u32("conn")?;
    let inner = Fields::parse(data)?;
    // The record's own topic is the one recorded to; the inner one is the publisher's.
    let topic = fields.text("topic").or_else(|| inner.text("topic"))?;
    Some((number, topic, inner.text("type")?))
}
