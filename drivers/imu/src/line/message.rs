//! One line: text to numbers, and back.

use std::fmt;

/// The longest line, bytes, its end not counted: all fields at their longest fit.
pub const LINE_MAX: usize = 255;

/// What a line says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineMessage {
    /// A sample of an IMU.
    Imu(ImuLine),
    /// A velocity of the robot.
    Twist(TwistLine),
}

/// A sample of an IMU, in the device's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuLine {
    /// Its number; 16 bits, then it begins anew.
    pub sequence: Option<u16>,
    /// When it was measured, ns of the device's own clock.
    pub stamp_ns: Option<i64>,
    /// Angular rate, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Specific force, m/s^2.
    pub acceleration_m_s2: [f64; 3],
}

/// A velocity of the robot in `base_link`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwistLine {
    /// Its number; 16 bits, then it begins anew.
    pub sequence: Option<u16>,
    /// When it was measured, ns of the device's own clock.
    pub stamp_ns: Option<i64>,
    /// Forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// Standard deviations of these; 0 is unknown.
    pub sigma: [f64; 3],
}

/// Why a line is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// Its checksum is not that of its bytes.
    #[error("the checksum is {found:02X}, the bytes have {computed:02X}")]
    Checksum {
        /// What the line says.
        found: u8,
        /// What its bytes have.
        computed: u8,
    },
    /// A later version may know it.
    #[error("it begins with neither imu nor twist")]
    Kind,
    /// Too few or too many fields, or one that is no number.
    #[error("field {field} is missing, too much or no number")]
    Field {
        /// Its place in the line; the kind is 0.
        field: usize,
    },
}

impl LineMessage {
    /// Reads a line without its end.
    pub fn decode(line: &[u8]) -> Result<Self, LineError> {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let text = str::from_utf8(line).map_err(|_| LineError::Kind)?;
        let body = match text.split_once('*') {
            Some((body, digits)) => {
                check(body, digits)?;
                body
            }
            None => text,
        };
        let mut fields = Fields {
            rest: body.split(','),
            field: 0,
        };
        match fields.rest.next() {
            Some("imu") => {
                let imu = ImuLine {
                    sequence: fields.whole()?,
                    stamp_ns: fields.whole()?,
                    rate_rad_s: fields.three()?,
                    acceleration_m_s2: fields.three()?,
                };
                fields.end()?;
                Ok(Self::Imu(imu))
            }
            Some("twist") => {
                let mut twist = TwistLine {
                    sequence: fields.whole()?,
                    stamp_ns: fields.whole()?,
                    velocity: fields.three()?,
                    sigma: [0.0; 3],
                };
                if fields.rest.clone().next().is_some() {
                    twist.sigma = fields.three()?;
                }
                fields.end()?;
                Ok(Self::Twist(twist))
            }
            _ => Err(LineError::Kind),
        }
    }

    /// The line with its checksum and its end.
    pub fn encode(&self) -> String {
        let body = self.to_string();
        format!("{body}*{:02X}\n", checksum(&body))
    }
}

impl fmt::Display for LineMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, sequence, stamp_ns, first, second) = match self {
            Self::Imu(imu) => (
                "imu",
                imu.sequence,
                imu.stamp_ns,
                imu.rate_rad_s,
                imu.acceleration_m_s2,
            ),
            Self::Twist(twist) => (
                "twist",
                twist.sequence,
                twist.stamp_ns,
                twist.velocity,
                twist.sigma,
            ),
        };
        f.write_str(kind)?;
        f.write_str(",")?;
        sequence.map_or(Ok(()), |number| write!(f, "{number}"))?;
        f.write_str(",")?;
        stamp_ns.map_or(Ok(()), |number| write!(f, "{number}"))?;
        // As short as they can be read back to the last bit.
        first
            .iter()
            .chain(&second)
            .try_for_each(|number| write!(f, ",{number:?}"))
    }
}

/// The fields behind the kind.
struct Fields<'a> {
    rest: std::str::Split<'a, char>,
    field: usize,
}

impl Fields<'_> {
    fn next<T>(&mut self, read: impl FnOnce(&str) -> Option<T>) -> Result<T, LineError> {
        self.field += 1;
        let field = self.field;
        let read = self.rest.next().and_then(read);
        read.ok_or(LineError::Field { field })
    }

    /// A whole number without a sign; none where the field is empty.
    fn whole<T: std::str::FromStr>(&mut self) -> Result<Option<T>, LineError> {
        self.next(|text| {
            let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
            match text {
                "" => Some(None),
                digits if is_number => digits.parse().ok().map(Some),
                _ => None,
            }
        })
    }

    fn three(&mut self) -> Result<[f64; 3], LineError> {
        // "nan" and "inf" are numbers to Rust.
        let mut number = || self.next(|text| text.parse().ok().filter(|it: &f64| it.is_finite()));
        Ok([number()?, number()?, number()?])
    }

    fn end(&mut self) -> Result<(), LineError> {
        let field = self.field + 1;
        match self.rest.next() {
            None => Ok(()),
            Some(_) => Err(LineError::Field { field }),
        }
    }
}

/// As of NMEA 0183: all bytes before the star, exclusive or.
fn checksum(body: &str) -> u8 {
    body.bytes().fold(0, |sum, byte| sum ^ byte)
}

fn check(body: &str, digits: &str) -> Result<(), LineError> {
    let computed = checksum(body);
    let are_digits = digits.len() == 2 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let found = u8::from_str_radix(digits, 16).ok().filter(|_| are_digits);
    match found {
        Some(found) if found == computed => Ok(()),
        // What is no number is not what the bytes have either.
        found => Err(LineError::Checksum {
            found: found.unwrap_or(!computed),
            computed,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lines_are_read() {
        let imu = ImuLine {
            sequence: Some(17),
            stamp_ns: Some(123_456_789),
            rate_rad_s: [0.01, -0.02, 0.5],
            acceleration_m_s2: [0.1, 0.0, 9.81],
        };
        let text = "imu,17,123456789,0.01,-0.02,5e-1,.1,0,9.81";
        assert_eq!(
            LineMessage::decode(text.as_bytes()),
            Ok(LineMessage::Imu(imu))
        );
        let bare = ImuLine {
            sequence: None,
            stamp_ns: None,
            ..imu
        };
        let text = "imu,,,0.01,-0.02,0.5,0.1,0,9.81\r";
        assert_eq!(
            LineMessage::decode(text.as_bytes()),
            Ok(LineMessage::Imu(bare))
        );
        let mut twist = TwistLine {
            velocity: [0.8, 0.0, -0.1],
            ..TwistLine::default()
        };
        let read = LineMessage::decode(b"twist,,,0.8,0,-0.1");
        assert_eq!(read, Ok(LineMessage::Twist(twist)));
        twist.sigma = [0.02, 0.01, 0.0];
        let read = LineMessage::decode(b"twist,,,0.8,0,-0.1,0.02,0.01,0");
        assert_eq!(read, Ok(LineMessage::Twist(twist)));
    }

    /// The document's.
    #[test]
    fn a_checksum_is_that_of_nmea() {
        let line = b"imu,17,123456789,0.01,-0.02,0.5,0.1,0.0,9.81*5C";
        let Ok(read) = LineMessage::decode(line) else {
            panic!("{:?}", LineMessage::decode(line));
        };
        assert_eq!(read.encode().as_bytes(), [&line[..], b"\n"].concat());
    }

    #[test]
    fn what_is_no_line_is_refused_with_its_field() {
        for (text, field) in [
            ("imu", 1),
            ("imu,1", 2),
            ("imu,-1,2,0,0,0,0,0,9.8", 1),
            ("imu,65536,2,0,0,0,0,0,9.8", 1),
            ("imu,1,9223372036854775808,0,0,0,0,0,9.8", 2),
            ("imu,1,+2,0,0,0,0,0,9.8", 2),
            ("imu,1,2,nan,0,0,0,0,9.8", 3),
            ("imu,1,2,0,inf,0,0,0,9.8", 4),
            ("imu,1,2,0,0,1e999,0,0,9.8", 5),
            ("imu,1,2,0,0,0,0,0", 8),
            ("imu,1,2,0,0,0,0,0,", 8),
            ("imu,1,2,0,0,0,0,0,9.8,1", 9),
            ("imu,1,2,0,0,0,0, 0,9.8", 7),
            ("twist,1,2,0.5,0", 5),
            ("twist,1,2,0.5,0,0,0.1", 7),
            ("twist,1,2,0.5,0,0,0.1,0.1,0.1,0.1", 9),
        ] {
            let read = LineMessage::decode(text.as_bytes());
            assert_eq!(read, Err(LineError::Field { field }), "{text}");
        }
        for text in ["", "IMU,1,2,0,0,0,0,0,9.8", " imu", "gps,1", "\u{e4}"] {
            let read = LineMessage::decode(text.as_bytes());
            assert_eq!(read, Err(LineError::Kind), "{text}");
        }
        assert_eq!(LineMessage::decode(b"\xff,"), Err(LineError::Kind));
        for text in [
            "twist,,,1,0,0*",
            "twist,,,1,0,0*0",
            "twist,,,1,0,0*00",
            "twist,,,1,0,0*+5",
        ] {
            let read = LineMessage::decode(text.as_bytes());
            assert!(
                matches!(read, Err(LineError::Checksum { .. })),
                "{text}: {read:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_read_back(
            sequence: Option<u16>,
            stamp_ns in prop::option::of(0..=i64::MAX),
            numbers: [f64; 6],
            is_imu: bool,
        ) {
            prop_assume!(numbers.iter().all(|number| number.is_finite()));
            let [a, b, c, d, e, f] = numbers;
            let (first, second) = ([a, b, c], [d, e, f]);
            let message = if is_imu {
                LineMessage::Imu(ImuLine {
                    sequence,
                    stamp_ns,
                    rate_rad_s: first,
                    acceleration_m_s2: second,
                })
            } else {
                LineMessage::Twist(TwistLine { sequence, stamp_ns, velocity: first, sigma: second })
            };
            let line = message.encode();
            prop_assert!(line.len() <= LINE_MAX + 1);
            let line = line.strip_suffix('\n').unwrap();
            prop_assert_eq!(LineMessage::decode(line.as_bytes()), Ok(message));
            let body = line.split_once('*').unwrap().0;
            prop_assert_eq!(LineMessage::decode(body.as_bytes()), Ok(message));
        }

        /// A line of one changed byte is no other line with a right checksum. One whose star is
        /// gone has none: the decoder asks for it.
        #[test]
        fn a_changed_byte_is_noticed(at in 0_usize..60, other: u8) {
            let message = LineMessage::Twist(TwistLine {
                sequence: Some(7),
                velocity: [0.51, -0.01, 0.33],
                ..TwistLine::default()
            });
            let mut line = message.encode().into_bytes();
            line.pop();
            let at = at % line.len();
            let before = std::mem::replace(&mut line[at], other);
            let read = LineMessage::decode(&line);
            let is_same = before == other || before.eq_ignore_ascii_case(&other);
            let has_checksum = line.contains(&b'*');
            prop_assert!(is_same || !has_checksum || read.is_err(), "{read:?}");
        }

        #[test]
        fn any_bytes_are_read_without_a_panic(line in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = LineMessage::decode(&line);
        }
    }
}
