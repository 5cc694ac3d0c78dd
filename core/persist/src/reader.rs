//! Reads values one after the other.

use crate::Error;
use bytemuck::Pod;

/// What is left of a saved state.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// At the beginning of bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// The next bytes.
    #[inline]
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let (taken, left) = self.bytes.split_at_checked(count).ok_or(Error::Shape)?;
        self.bytes = left;
        Ok(taken)
    }

    /// The next plain value.
    #[inline]
    pub fn plain<T: Pod>(&mut self) -> Result<T, Error> {
        self.bytes(size_of::<T>()).map(bytemuck::pod_read_unaligned)
    }

    /// The next number that [`Writer::varint`](crate::Writer::varint) wrote.
    #[inline]
    pub fn varint(&mut self) -> Result<u64, Error> {
        let mut value = 0;
        for shift in (0..u64::BITS).step_by(7) {
            let byte: u8 = self.plain()?;
            let bits = u64::from(byte & 0x7f);
            value |= bits << shift;
            if bits << shift >> shift != bits {
                return Err(Error::Unsound("varint"));
            }
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(Error::Unsound("varint"))
    }

    /// Bytes that are left.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes
    }

    /// Makes sure that nothing is left.
    pub fn end(&self) -> Result<(), Error> {
        let is_at_end = self.bytes.is_empty();
        is_at_end.then_some(()).ok_or(Error::Shape)
    }
}
