//! Writes values one after the other into a buffer that is there.

use bytemuck::Pod;

/// A place in the caller's buffer. Nothing is allocated; what does not fit is counted.
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

    /// Bytes so far, whether they found room or not.
    pub fn written(&self) -> usize {
        self.written
    }
}
