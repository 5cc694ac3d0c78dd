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
    /// Whether lines of an IMU, and of wheels, were seen to end with a checksum.
    imu_has_checksums: bool,
    twist_has_checksums: bool,
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

    /// Another device may speak, or the same one begun anew: numbers begin anew, and it may send
    /// lines without checksums.
    pub fn restart(&mut self) {
        let lines = &mut self.lines;
        lines.imu.restart();
        lines.twist.restart();
        (lines.imu_has_checksums, lines.twist_has_checksums) = (false, false);
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
        let Lines {
            imu, twist, counts, ..
        } = &self.lines;
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
        let (order, has_checksums, sequence) = match &message {
            LineMessage::Imu(imu) => (&mut self.imu, &mut self.imu_has_checksums, imu.sequence),
            LineMessage::Twist(twist) => (
                &mut self.twist,
                &mut self.twist_has_checksums,
                twist.sequence,
            ),
        };
        // Where others end with one, a line without has lost its star to noise: what is behind it
        // would be read as digits.
        let has_checksum = line.contains(&b'*');
        if *has_checksums && !has_checksum {
            self.counts.checksum_errors += 1;
            return;
        }
        *has_checksums = has_checksum;
        if order.is_next(sequence) {
            self.counts.lines += 1;
            sink(message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A star that noise has turned into a digit: the last number would be 0.042, not 0.0.
    #[test]
    fn where_lines_have_checksums_one_without_is_damaged() {
        let mut decoder = LineDecoder::default();
        let mut came = 0;
        let mut push = |decoder: &mut LineDecoder, bytes: &[u8]| {
            decoder.stream(bytes, &mut |_| came += 1);
            came
        };
        let imu = b"imu,,,0,0,0.1,0,0,9.8\n";
        assert_eq!(push(&mut decoder, imu), 1);
        let twist = b"twist,17,123450000,0.8,0.0,-0.1,0.02,0.01,0.05*48\n";
        assert_eq!(push(&mut decoder, twist), 2);
        let damaged = b"twist,18,123450000,0.8,0.0,-0.1,0.02,0.01,0.05048\n";
        assert_eq!(push(&mut decoder, damaged), 2);
        let errors = decoder.counts().remove(2);
        assert_eq!((errors.name, errors.value), ("checksum_errors", 1));
        // Lines of an IMU are asked by themselves; another device may have none.
        assert_eq!(push(&mut decoder, imu), 3);
        decoder.restart();
        assert_eq!(push(&mut decoder, damaged), 4);
    }

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
