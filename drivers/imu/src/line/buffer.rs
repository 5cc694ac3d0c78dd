//! Bytes to lines.

use super::LINE_MAX;

/// The bytes that are not yet a whole line.
#[derive(Debug, Default)]
pub(super) struct LineBuffer {
    bytes: Vec<u8>,
    /// Up to the next end nothing counts: the line is too long, or its beginning was not seen.
    skips: bool,
    /// Lines that were too long.
    pub overlong: u64,
}

impl LineBuffer {
    /// Takes what was read; gives every whole line that is not empty.
    pub fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(&[u8])) {
        let mut rest = bytes;
        while let Some(end) = rest.iter().position(|byte| *byte == b'\n') {
            let (line, behind) = rest.split_at(end);
            self.hold(line);
            self.end(take);
            rest = behind.get(1..).unwrap_or_default();
        }
        self.hold(rest);
    }

    fn hold(&mut self, piece: &[u8]) {
        if self.skips {
            return;
        }
        // One more for a carriage return.
        if self.bytes.len() + piece.len() > LINE_MAX + 1 {
            self.overlong += 1;
            self.bytes.clear();
            self.skips = true;
        } else {
            self.bytes.extend_from_slice(piece);
        }
    }

    /// A line is at its end, or a datagram: what is held is a line.
    pub fn end(&mut self, take: &mut dyn FnMut(&[u8])) {
        if !std::mem::take(&mut self.skips) && !matches!(self.bytes[..], [] | [b'\r']) {
            take(&self.bytes);
        }
        self.bytes.clear();
    }

    /// What follows may begin inside a line.
    pub fn cut(&mut self) {
        self.bytes.clear();
        self.skips = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lines(buffer: &mut LineBuffer, bytes: &[u8], piece: usize) -> Vec<Vec<u8>> {
        let mut lines = Vec::new();
        for piece in bytes.chunks(piece) {
            buffer.push(piece, &mut |line| lines.push(line.to_vec()));
        }
        lines
    }

    #[test]
    fn half_a_line_at_the_beginning_is_none() {
        let mut buffer = LineBuffer::default();
        buffer.cut();
        let found = lines(&mut buffer, b"81\na\n\n\r\nb\r\nc", 3);
        assert_eq!(found, [&b"a"[..], b"b\r"]);
        let mut last = Vec::new();
        buffer.end(&mut |line| last = line.to_vec());
        assert_eq!((last, buffer.overlong), (b"c".to_vec(), 0));
    }

    #[test]
    fn a_line_without_an_end_holds_nothing_up() {
        let mut buffer = LineBuffer::default();
        let long = [b'x'; 100_000];
        assert!(lines(&mut buffer, &long, 999).is_empty());
        assert!(buffer.bytes.capacity() < 2 * 1024);
        assert_eq!(lines(&mut buffer, b"x\nimu\n", 2), [b"imu"]);
        assert_eq!(buffer.overlong, 1);
    }

    proptest! {
        #[test]
        fn pieces_make_no_difference(
            bytes in prop::collection::vec(prop_oneof![Just(b'\n'), any::<u8>()], 0..400),
            piece in 1_usize..50,
        ) {
            let whole = lines(&mut LineBuffer::default(), &bytes, 400);
            prop_assert_eq!(lines(&mut LineBuffer::default(), &bytes, piece), whole);
        }
    }
}
