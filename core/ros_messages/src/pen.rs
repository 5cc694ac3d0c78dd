//! Serialises.

/// How ROS serialises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// ROS 1: packed.
    Ros1,
    /// ROS 2: CDR, little-endian, aligned.
    Cdr,
}

/// Writes one message, field by field.
pub(crate) struct Pen {
    bytes: Vec<u8>,
    style: Style,
}

impl Pen {
    pub fn new(style: Style) -> Self {
        let bytes = match style {
            Style::Ros1 => Vec::new(),
            // Little-endian.
            Style::Cdr => vec![0, 1, 0, 0],
        };
        Self { bytes, style }
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        // Alignment counts from behind the four bytes that name the kind of CDR.
        while self.style == Style::Cdr && !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(bytes);
    }

    pub fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    pub fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    pub fn f32s(&mut self, values: &[f32]) {
        for value in values {
            self.put(value.to_le_bytes());
        }
    }

    pub fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.put(value.to_le_bytes());
        }
    }

    /// Bytes without a length: an array, or what stands before the message.
    pub fn bare(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    pub fn blob(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
    }

    pub fn string(&mut self, text: &str) {
        let end = match self.style {
            Style::Ros1 => "",
            Style::Cdr => "\0",
        };
        self.u32((text.len() + end.len()) as u32);
        self.bytes.extend(text.as_bytes());
        self.bytes.extend(end.as_bytes());
    }

    pub fn stamp(&mut self, stamp_ns: i64) {
        for value in time(stamp_ns) {
            self.u32(value);
        }
    }

    /// A header; ROS 2's has no sequence number.
    pub fn header(&mut self, sequence: u64, stamp_ns: i64, frame: &str) {
        if self.style == Style::Ros1 {
            self.u32(sequence as u32);
        }
        self.stamp(stamp_ns);
        self.string(frame);
    }

    /// A pose in the plane.
    pub fn pose(&mut self, [x_m, y_m, yaw_rad]: [f64; 3]) {
        self.f64s(&[x_m, y_m, 0.0]);
        self.f64s(&crate::about_z(yaw_rad));
    }

    pub fn end(self) -> Vec<u8> {
        self.bytes
    }
}

/// Seconds and nanoseconds; ROS's time begins in 1970.
pub fn time(stamp_ns: i64) -> [u32; 2] {
    let seconds = stamp_ns.div_euclid(1_000_000_000);
    let nanoseconds = stamp_ns.rem_euclid(1_000_000_000);
    [u32::try_from(seconds).unwrap_or(0), nanoseconds as u32]
}
