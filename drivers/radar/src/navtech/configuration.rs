//! The configuration that a Navtech sends on connecting.
//!
//! Source: IASDK (MIT): the fixed part in its C++ header `Configuration` and the Python examples;
//! the protobuf tail (`ConfigurationData`) from the message in its network tests, of which we read
//! four fields.

use crate::bytes::Bytes;

/// Plausible gains of the range: the vendor's is 1, and a calibration changes it by per cents.
const GAINS: core::ops::RangeInclusive<f32> = 0.5..=2.0;
/// Longest plausible offset of the range, m: a calibration's are below a few bins.
const OFFSET_MAX_M: f32 = 50.0;

/// A radar's configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// Beams of a turn.
    pub azimuths: u16,
    /// Width of a bin, 0.1 mm.
    pub bin_size_01mm: u16,
    /// Bins of a beam without a contour.
    pub bins: u16,
    /// Counts of the encoder in a turn.
    pub encoder_size: u16,
    /// Turns a second, mHz.
    pub rotation_mhz: u16,
    /// Beams a second.
    pub packets_per_s: u16,
    /// Factor on range.
    pub range_gain: f32,
    /// Added to range, m.
    pub range_offset_m: f32,
    /// The content of the protobuf tail.
    pub details: Details,
}

/// Of the protobuf tail what is of use.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Details {
    /// Such as CTS350.
    pub model: String,
    /// Its network address.
    pub mac: String,
    /// Bytes a bin as the radar counts them.
    pub data_width: Option<u64>,
    /// Width of a bin, m, with more digits than the fixed part has.
    pub range_resolution_m: Option<f32>,
}

impl Configuration {
    /// Reads a message's body; `None` where the fixed part is short or senseless. A tail that
    /// cannot be read is left.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let mut bytes = Bytes(payload);
        let configuration = Self {
            azimuths: bytes.u16_be()?,
            bin_size_01mm: bytes.u16_be()?,
            bins: bytes.u16_be()?,
            encoder_size: bytes.u16_be()?,
            rotation_mhz: bytes.u16_be()?,
            packets_per_s: bytes.u16_be()?,
            range_gain: bytes.f32_be()?,
            range_offset_m: bytes.f32_be()?,
            details: Details::decode(bytes.0),
        };
        let sensible = configuration.encoder_size > 0
            && configuration.bin_m() > 0.0
            && GAINS.contains(&configuration.range_gain)
            && configuration.range_offset_m.abs() <= OFFSET_MAX_M;
        sensible.then_some(configuration)
    }

    /// Appends a message's body.
    pub fn encode(&self, out: &mut Vec<u8>) {
        for number in [
            self.azimuths,
            self.bin_size_01mm,
            self.bins,
            self.encoder_size,
            self.rotation_mhz,
            self.packets_per_s,
        ] {
            out.extend_from_slice(&number.to_be_bytes());
        }
        out.extend_from_slice(&self.range_gain.to_be_bytes());
        out.extend_from_slice(&self.range_offset_m.to_be_bytes());
        self.details.encode(out);
    }

    /// Width of a bin before the gain, m.
    pub fn bin_m(&self) -> f64 {
        let fixed_m = f64::from(self.bin_size_01mm) * 1e-4;
        // A tail that contradicts the fixed part by more than its rounding is ignored.
        match self.details.range_resolution_m.map(f64::from) {
            Some(fine_m) if (fine_m - fixed_m).abs() <= 1e-4 => fine_m,
            _ => fixed_m,
        }
    }
}

/// Protobuf's ways to write a value.
const VARINT: u64 = 0;
const FIXED_64: u64 = 1;
const LENGTH: u64 = 2;
const FIXED_32: u64 = 5;

/// A field's value.
enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
    Float(f32),
    Other,
}

fn varint(bytes: &mut Bytes<'_>) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let byte = bytes.u8()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// The next field's number and value.
fn field<'a>(bytes: &mut Bytes<'a>) -> Option<(u64, Value<'a>)> {
    let tag = varint(bytes)?;
    let value = match tag & 7 {
        VARINT => Value::Number(varint(bytes)?),
        FIXED_64 => bytes.array::<8>().map(|_| Value::Other)?,
        LENGTH => {
            let length = usize::try_from(varint(bytes)?).ok()?;
            Value::Bytes(bytes.slice(length)?)
        }
        FIXED_32 => Value::Float(bytes.array().map(f32::from_le_bytes)?),
        _ => return None,
    };
    Some((tag >> 3, value))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

impl Details {
    fn decode(tail: &[u8]) -> Self {
        let mut details = Self::default();
        let mut bytes = Bytes(tail);
        while let Some((number, value)) = field(&mut bytes) {
            match (number, value) {
                (1, Value::Bytes(model)) => details.read_model(model),
                (2, Value::Bytes(mac)) => details.mac = text(mac),
                (9, Value::Number(width)) => details.data_width = Some(width),
                (10, Value::Float(metres)) => details.range_resolution_m = Some(metres),
                _ => {}
            }
        }
        details
    }

    fn read_model(&mut self, model: &[u8]) {
        let mut bytes = Bytes(model);
        while let Some((number, value)) = field(&mut bytes) {
            if let (2, Value::Bytes(name)) = (number, value) {
                self.model = text(name);
            }
        }
    }

    fn encode(&self, out: &mut Vec<u8>) {
        let mut model = vec![0x08, 0x00];
        write_bytes(2, self.model.as_bytes(), &mut model);
        write_bytes(1, &model, out);
        write_bytes(2, self.mac.as_bytes(), out);
        if let Some(width) = self.data_width {
            out.push(9 << 3);
            write_varint(width, out);
        }
        if let Some(metres) = self.range_resolution_m {
            out.push(10 << 3 | FIXED_32 as u8);
            out.extend_from_slice(&metres.to_le_bytes());
        }
    }
}

fn write_bytes(number: u8, bytes: &[u8], out: &mut Vec<u8>) {
    out.push(number << 3 | LENGTH as u8);
    write_varint(bytes.len() as u64, out);
    out.extend_from_slice(bytes);
}

fn write_varint(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::navtech::frame::{FrameParser, kind};
    use proptest::prelude::*;

    /// IASDK (MIT), network unit tests, `real_data` of `GivenAColossusMessage`: what a CTS350
    /// sent.
    const VENDOR_REAL_DATA: &str = "
        000103030707 0F0F1F1F3F3F7F7FFEFE 010A00000187 019006D80B2815E00FA0 06403F8000000000 0000 0A6508001206
        435453333530 1A2438423746423737392D363545442D343032382D393136312D 374339433635323035343237 250000FA
        432A243137374546303039 2D383132462D344142462D424535392D4633384334 3037323544304335 0000003F3DCDCC4C
        3F121135343A31303A65633A36653A61353A3065 1A4E0A08332E302E302E3634 1208332E302E302E3935 1A08332E302E
        302E3935 2207342E302E302E39 2A0A342E31302E302E323132 3207372E302E302E30 3A07302E302E302E30 4207302E30
        2E302E30 225308F50A10FE02186F2000 2803300038004000 4D00000000588095 FDDB056080BB9AA7066A24384237464237
        37392D363545442D343032382D393136312D374339433635323035343237 70 007800800101880101 2DA040DD44 3206
        366561353065 388004 4224353431304543 36452D353045352D313045432D45 4135302D353431304543364541353045 48
        01 559B71333E 5806 6000 6A1130303A30 633A63363A38373A39373A3363";

    fn hex(text: &str) -> Vec<u8> {
        let digits: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        digits
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect()
    }

    #[test]
    fn the_vendors_cts350_is_read() {
        let bytes = hex(VENDOR_REAL_DATA);
        assert_eq!(bytes.len(), 22 + 0x187);
        let mut parser = FrameParser::default();
        parser.push(&bytes);
        let frame = parser.next().unwrap();
        assert_eq!(frame.kind, kind::CONFIGURATION);
        let configuration = Configuration::decode(frame.payload).unwrap();
        // The vendor's own test asks for these three.
        assert_eq!(configuration.rotation_mhz, 4000);
        assert_eq!(configuration.bins, 2856);
        assert_eq!(configuration.azimuths, 400);
        assert_eq!(configuration.encoder_size, 5600);
        assert_eq!(configuration.packets_per_s, 1600);
        assert_eq!(configuration.range_gain, 1.0);
        assert_eq!(configuration.details.model, "CTS350");
        assert_eq!(configuration.details.mac, "54:10:ec:6e:a5:0e");
        assert_eq!(configuration.details.data_width, Some(1));
        assert!((configuration.bin_m() - 0.175238).abs() < 1e-6);
        // The fixed part both ways.
        let mut encoded = Vec::new();
        configuration.encode(&mut encoded);
        assert_eq!(encoded[..20], frame.payload[..20]);
    }

    #[test]
    fn a_tail_that_is_damaged_costs_no_more_than_itself() {
        let bytes = hex(VENDOR_REAL_DATA);
        for end in 42..bytes.len() {
            let configuration = Configuration::decode(&bytes[22..end]).unwrap();
            assert_eq!(configuration.azimuths, 400);
        }
        assert_eq!(Configuration::decode(&bytes[22..41]), None);
    }

    proptest! {
        #[test]
        fn round_trip(
            numbers in any::<[u16; 6]>(),
            gain in 0.5..2.0_f32,
            offset in -9.0..9.0_f32,
            model in "[A-Z0-9]{0,200}",
            width in prop::option::of(any::<u64>()),
            resolution in prop::option::of(0.01..1.0_f32),
        ) {
            let configuration = Configuration {
                azimuths: numbers[0],
                bin_size_01mm: numbers[1].max(1),
                bins: numbers[2],
                encoder_size: numbers[3].max(1),
                rotation_mhz: numbers[4],
                packets_per_s: numbers[5],
                range_gain: gain,
                range_offset_m: offset,
                details: Details { model, mac: "m".to_owned(), data_width: width, range_resolution_m: resolution },
            };
            let mut bytes = Vec::new();
            configuration.encode(&mut bytes);
            prop_assert_eq!(Configuration::decode(&bytes), Some(configuration));
        }

        #[test]
        fn no_bytes_break_it(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = Configuration::decode(&bytes);
        }
    }
}
