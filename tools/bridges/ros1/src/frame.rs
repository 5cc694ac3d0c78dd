//! A message of ROS on its way between this process and its node: see `randt_ros1.py`.

/// Longest frame: a polar image of a Navtech has 1.5 MB, a grid of a square kilometre 100.
const FRAME_MAX: usize = 1 << 27;
/// Bytes before a frame's end that are there at least: flag, two lengths, nanoseconds.
const FRAME_MIN: usize = 11;

/// A message.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Whether who subscribes late gets it.
    pub is_latched: bool,
    pub topic: String,
    /// Package and name, as `nav_msgs/Odometry`.
    pub type_name: String,
    /// Whether it only says that there will be messages or, without a topic, that the node is
    /// there.
    pub is_announcement: bool,
    /// When it came, or its stamp.
    pub time_ns: i64,
    /// As ROS 1 serialises it.
    pub message: Vec<u8>,
}

impl Frame {
    /// Its bytes. Names of topics and types have at most 255 bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut rest = vec![u8::from(self.is_latched) | u8::from(self.is_announcement) << 1];
        for text in [&self.topic, &self.type_name] {
            let text = text.as_bytes();
            let text = text.get(..255).unwrap_or(text);
            rest.push(text.len() as u8);
            rest.extend(text);
        }
        rest.extend(self.time_ns.to_le_bytes());
        rest.extend(&self.message);
        let mut bytes = (rest.len() as u32).to_le_bytes().to_vec();
        bytes.append(&mut rest);
        bytes
    }

    /// What follows the length; `None` where it is no frame.
    fn parse(bytes: &[u8]) -> Option<Self> {
        let (flags, rest) = bytes.split_first().filter(|(flags, _)| **flags < 4)?;
        let (topic, rest) = text(rest)?;
        let (type_name, rest) = text(rest)?;
        let (time_ns, message) = rest.split_first_chunk()?;
        Some(Self {
            is_latched: flags & 1 != 0,
            is_announcement: flags & 2 != 0,
            topic,
            type_name,
            time_ns: i64::from_le_bytes(*time_ns),
            message: message.to_vec(),
        })
    }
}

fn text(bytes: &[u8]) -> Option<(String, &[u8])> {
    let (length, rest) = bytes.split_first()?;
    let (text, rest) = rest.split_at_checked(usize::from(*length))?;
    Some((str::from_utf8(text).ok()?.to_owned(), rest))
}

/// Cuts a stream of bytes into frames.
#[derive(Debug, Default)]
pub struct Decoder {
    bytes: Vec<u8>,
    begin: usize,
}

/// The stream is none of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoFrame;

impl Decoder {
    /// Takes what has come.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.begin);
        self.begin = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole frame.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, NoFrame> {
        let rest = self.bytes.get(self.begin..).unwrap_or_default();
        let Some((length, rest)) = rest.split_first_chunk() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes(*length) as usize;
        if !(FRAME_MIN..=FRAME_MAX).contains(&length) {
            return Err(NoFrame);
        }
        let Some(frame) = rest.get(..length) else {
            return Ok(None);
        };
        let frame = Frame::parse(frame).ok_or(NoFrame)?;
        self.begin += 4 + length;
        Ok(Some(frame))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    fn frame(topic: &str, message: &[u8]) -> Frame {
        Frame {
            is_latched: message.len().is_multiple_of(2),
            is_announcement: message.is_empty(),
            topic: topic.to_owned(),
            type_name: "sensor_msgs/Imu".to_owned(),
            time_ns: -5,
            message: message.to_vec(),
        }
    }

    #[test]
    fn a_stream_cut_anywhere_gives_its_frames() {
        let frames = [frame("/imu", &[1, 2, 3]), frame("/ä", &[]), frame("", &[9])];
        let stream: Vec<u8> = frames.iter().flat_map(Frame::to_bytes).collect();
        for size in 1..stream.len() {
            let (mut decoder, mut found) = (Decoder::default(), Vec::new());
            for piece in stream.chunks(size) {
                decoder.push(piece);
                while let Some(frame) = decoder.next_frame().unwrap() {
                    found.push(frame);
                }
            }
            assert_eq!(found, frames);
        }
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        let whole = frame("/imu", &[1]).to_bytes();
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << bit;
                let mut decoder = Decoder::default();
                decoder.push(&bytes);
                // Another frame, none yet, or an error: no bit is without a meaning.
                let found = decoder.next_frame();
                assert!(
                    found != Ok(Some(frame("/imu", &[1]))),
                    "bit {bit} of byte {at}"
                );
            }
        }
        let mut decoder = Decoder::default();
        decoder.push(&[255; 8]);
        assert_eq!(decoder.next_frame(), Err(NoFrame));
    }
}
