//! A cursor over a serialised ROS message, ROS 1 or CDR (ROS 2).
//!
//! The two differ in alignment, byte order, the terminating zero of strings and the sequence
//! number of the header; all four live here, so that each message type has one decoder.

use std::borrow::Cow;

/// How a message is serialised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// ROS 1: packed, little-endian.
    Ros1,
    /// ROS 2: CDR behind a 4-byte encapsulation header that has the byte order.
    Cdr,
}

/// Why a message cannot be decoded: the offset and what should be there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} at byte {at} of a message of {length}")]
pub(crate) struct Malformed {
    pub what: Cow<'static, str>,
    pub at: usize,
    pub length: usize,
}

/// Reads a message from its beginning to its end. Never past it.
pub(crate) struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    aligned: bool,
    big_endian: bool,
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RosHeader {
    pub stamp_ns: i64,
    pub frame: String,
}

impl<'a> Wire<'a> {
    pub fn new(bytes: &'a [u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Self {
            bytes,
            at: 0,
            aligned: false,
            big_endian: false,
        };
        if encoding == Encoding::Cdr {
            // Representation identifiers 0 and 1 are plain CDR; others (XCDR2, parameter lists)
            // are not ROS 2's.
            let kind = wire.array::<4>()?;
            wire.big_endian = match kind {
                [0, 0, ..] => true,
                [0, 1, ..] => false,
                _ => return Err(wire.malformed("encapsulation other than CDR")),
            };
            wire.aligned = true;
            // Alignment counts from behind the encapsulation header.
            wire.bytes = bytes.get(4..).unwrap_or_default();
            wire.at = 0;
        }
        Ok(wire)
    }

    pub fn malformed(&self, what: impl Into<Cow<'static, str>>) -> Malformed {
        Malformed {
            what: what.into(),
            at: self.at,
            length: self.bytes.len(),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Malformed> {
        let end = self.at.checked_add(count);
        let slice = end.and_then(|end| self.bytes.get(self.at..end));
        let slice = slice.ok_or_else(|| self.malformed("end of data"))?;
        self.at += count;
        Ok(slice)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        if self.aligned && N > 1 {
            self.at = self.at.next_multiple_of(N);
        }
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        if self.big_endian {
            array.reverse();
        }
        Ok(array)
    }

    pub fn u8(&mut self) -> Result<u8, Malformed> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    pub fn u16(&mut self) -> Result<u16, Malformed> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub fn u32(&mut self) -> Result<u32, Malformed> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub fn u64(&mut self) -> Result<u64, Malformed> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub fn f32(&mut self) -> Result<f32, Malformed> {
        Ok(f32::from_le_bytes(self.array()?))
    }

    pub fn f64(&mut self) -> Result<f64, Malformed> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Malformed> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// A sequence of any type, each of at least `size` bytes.
    pub fn sequence<T>(
        &mut self,
        size: usize,
        read: impl Fn(&mut Self) -> Result<T, Malformed>,
    ) -> Result<Vec<T>, Malformed> {
        let length = self.u32()? as usize;
        if length > self.remaining() / size.max(1) {
            return Err(self.malformed("sequence longer than its message"));
        }
        (0..length).map(|_| read(self)).collect()
    }

    /// Bytes behind the cursor.
    pub fn remaining(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self) -> Result<&'a [u8], Malformed> {
        let length = self.u32()? as usize;
        self.take(length)
    }

    pub fn string(&mut self) -> Result<String, Malformed> {
        let mut text = self.bytes()?;
        if self.aligned {
            text = text.strip_suffix(&[0]).unwrap_or(text);
        }
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    pub fn header(&mut self) -> Result<RosHeader, Malformed> {
        if !self.aligned {
            self.u32()?; // ROS 1's sequence number, which publishers fill at will
        }
        // ROS 1 has unsigned seconds, ROS 2 signed ones; both are the same until 2038.
        let seconds = match (self.u32()?, self.aligned) {
            (seconds, true) => i64::from(seconds.cast_signed()),
            (seconds, false) => i64::from(seconds),
        };
        let nanoseconds = i64::from(self.u32()?);
        Ok(RosHeader {
            stamp_ns: seconds * 1_000_000_000 + nanoseconds,
            frame: self.string()?,
        })
    }
}
