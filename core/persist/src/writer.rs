//! Writes values one after the other into a buffer of the caller.

use bytemuck::Pod;

/// A position in the caller's buffer. Nothing is allocated; bytes that do not fit are counted.
#[derive(Debug)]
pub struct Writer<'a> {
    out: &'a mut [u8],
    written: usize,
}

impl<'a> Writer<'a> {
    /// At the beginning of a buffer.
    pub fn new(out: &'a mut [u8]) -> Self {
        Self { out, written: 0 }
    }

    /// Appends bytes.
    #[inline]
    pub fn bytes(&mut self, bytes: &[u8]) {
        let end = self.written + bytes.len();
        if let Some(to) = self.out.get_mut(self.written..end) {
            to.copy_from_slice(bytes);
        }
        self.written = end;
    }

    /// Appends a plain value.
    #[inline]
    pub fn plain<T: Pod>(&mut self, value: &T) {
        self.bytes(bytemuck::bytes_of(value));
    }

    /// Appends a number that is small as a rule: seven bits a byte, the lowest first, the highest
    /// bit set where more follow (LEB128).
    #[inline]
    pub fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes(&[value as u8 | 0x80]);
            value >>= 7;
        }
        self.bytes(&[value as u8]);
    }

    /// Bytes so far, whether they fitted or not.
    pub fn written(&self) -> usize {
        self.written
    }
}

/// Appends what `save` writes to a list of bytes. `save` runs twice: once to learn the length,
/// once to write.
pub fn append(out: &mut Vec<u8>, save: impl Fn(&mut Writer<'_>)) {
    let mut length = Writer::new(&mut []);
    save(&mut length);
    let start = out.len();
    out.resize(start + length.written(), 0);
    save(&mut Writer::new(out.get_mut(start..).unwrap_or_default()));
}
