//! Bytes to messages, with what was counted.

use super::buffer::LineBuffer;
use super::order::LineOrder;
use super::{LineError, LineMessage};
use randt_device::Count;

/// The protocol without its wire: bytes in, messages out.
#[derive(Debug, Default)]
pub struct LineDecoder {
    buffer: LineBuffer,
    lines: Lines,
}

#[derive(Debug, Default)]
struct Lines {
    imu: LineOrder,
    twist: LineOrder,
    counts: LineCounts,
}

#[derive(Debug, Default)]
struct LineCounts {
    lines: u64,
    malformed: u64,
    checksum_errors: u64,
    unknown: u64,
}

impl LineDecoder {
    /// Takes a piece of a stream.
    pub fn stream(&mut self, bytes: &[u8], sink: &mut dyn FnMut(LineMessage)) {
        let lines = &mut self.lines;
        self.buffer.push(bytes, &mut |line| lines.take(line, sink));
    }

    /// Takes a datagram, of one line or several; the last one may lack its end.
    pub fn datagram(&mut self, bytes: &[u8], sink: &mut dyn FnMut(LineMessage)) {
        let lines = &mut self.lines;
        let take: &mut dyn FnMut(&[u8]) = &mut |line| lines.take(line, sink);
        self.buffer.push(bytes, take);
        self.buffer.end(take);
    }

    /// A stream was opened, perhaps in the middle of a line.
    pub fn opened(&mut self) {
        self.buffer.cut();
        self.restart();
    }

    /// Another device may speak, or the same one begun anew: numbers begin anew.
    pub fn restart(&mut self) {
        self.lines.imu.restart();
        self.lines.twist.restart();
    }

    /// Lines that were used.
    pub fn lines(&self) -> u64 {
        self.lines.counts.lines
    }

    /// Twists that did not come, by their numbers; a driver counts samples itself.
    pub fn twists_lost(&self) -> u64 {
        self.lines.twist.lost
    }

    /// What was counted.
    pub fn counts(&self) -> Vec<Count> {
        let Lines { imu, twist, counts } = &self.lines;
        let malformed = counts.malformed + self.buffer.overlong;
        vec![
            Count::event("lines", counts.lines),
            Count::event("lines_malformed", malformed),
            Count::event("checksum_errors", counts.checksum_errors),
            Count::event("lines_of_another_kind", counts.unknown),
            Count::event("lines_out_of_order", imu.late + twist.late),
            Count::event("lines_doubled", imu.doubled + twist.doubled),
        ]
    }
}

impl Lines {
    fn take(&mut self, line: &[u8], sink: &mut dyn FnMut(LineMessage)) {
        let message = match LineMessage::decode(line) {
            Ok(message) => message,
            Err(error) => {
                let count = match error {
                    LineError::Checksum { .. } => &mut self.counts.checksum_errors,
                    LineError::Kind => &mut self.counts.unknown,
                    LineError::Field { .. } => &mut self.counts.malformed,
                };
                *count += 1;
                return;
            }
        };
        let is_next = match &message {
            LineMessage::Imu(imu) => self.imu.is_next(imu.sequence),
            LineMessage::Twist(twist) => self.twist.is_next(twist.sequence),
        };
        if is_next {
            self.counts.lines += 1;
            sink(message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_is_used_or_counted() {
        let mut decoder = LineDecoder::default();
        let mut came = Vec::new();
        let datagram = b"imu,1,,0,0,0.1,0,0,9.8\ntwist,1,,1,0,0\nimu,1,,0,0,0.1,0,0,9.8\n\
            imu,2,,0,0,x,0,0,9.8\ngps,1\n\ntwist,9,,1,0,0*00\ntwist,4,,1,0,0";
        decoder.datagram(datagram, &mut |message| came.push(message));
        decoder.datagram(b"imu,0,,0,0,0.1,0,0,9.8", &mut |message| came.push(message));
        assert_eq!((came.len(), decoder.twists_lost()), (3, 2));
        let counts: Vec<u64> = decoder.counts().iter().map(|count| count.value).collect();
        assert_eq!(counts, [3, 1, 1, 1, 1, 1]);
        decoder.stream(b"imu,7,,0,0,0.1,0,0,9.8\nimu,8,,0", &mut |message| {
            came.push(message)
        });
        assert_eq!(came.len(), 4);
        // The other half belongs to another opening.
        decoder.opened();
        decoder.stream(
            b",0,0.1,0,0,9.8\nimu,3,,0,0,0.1,0,0,9.8\n",
            &mut |message| came.push(message),
        );
        assert_eq!((came.len(), decoder.lines()), (5, 5));
    }
}
