//! A datagram of beam-udp, both ways. The protocol is our own: docs/beam-udp.md.

pub use super::crc::crc32c;
use crate::Echo;
use crate::bytes::Bytes;

/// What a datagram begins with.
pub const MAGIC: [u8; 4] = *b"RBM1";
/// The version of today.
pub const VERSION: u8 = 1;
/// Length of the header of today.
pub const HEADER_BYTES: usize = 48;
/// Longest datagram: fits an Ethernet frame with room for tunnels.
pub const DATAGRAM_MAX: usize = 1400;
/// Room for values: without header and checksum.
pub const PAYLOAD_MAX: usize = DATAGRAM_MAX - HEADER_BYTES - CRC_BYTES;
/// Length of the checksum.
const CRC_BYTES: usize = 4;
/// Flag: azimuths count clockwise, seen from above.
pub const CLOCKWISE: u16 = 1;

/// How values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Format {
    /// One byte a bin, 0.5 each.
    Dense8 = 0,
    /// Two bytes a bin, 0.01 each.
    Dense16 = 1,
    /// Bin and signed value, 0.1 each: four bytes a return.
    Sparse = 2,
}

impl Format {
    fn from_code(code: u8) -> Option<Self> {
        let all = [Self::Dense8, Self::Dense16, Self::Sparse];
        all.into_iter().find(|format| format.code() == code)
    }

    fn code(self) -> u8 {
        self as u8
    }

    /// Bytes of one value.
    pub fn width(self) -> usize {
        match self {
            Self::Dense8 => 1,
            Self::Dense16 => 2,
            Self::Sparse => 4,
        }
    }

    /// Most values of one datagram.
    pub fn values_max(self) -> usize {
        PAYLOAD_MAX / self.width()
    }
}

/// One datagram: a beam, or a fragment of one. Its fields are those of the protocol's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet<'a> {
    /// How values are written.
    pub format: Format,
    /// Distinguishes radars that send to one address.
    pub device: u32,
    /// Rises by one from sweep to sweep.
    pub sweep: u32,
    /// Number of the beam in its sweep, from 0.
    pub beam: u16,
    /// Beams of a whole sweep.
    pub beams: u16,
    /// Number of this fragment of the beam, from 0.
    pub fragment: u8,
    /// Fragments of the beam.
    pub fragments: u8,
    /// Dense: the bin of the first value here.
    pub first_bin: u16,
    /// [`CLOCKWISE`].
    pub flags: u16,
    /// 2^32 are one turn.
    pub azimuth: u32,
    /// When the beam was measured, ns of the radar's clock; 0: it has none.
    pub device_ns: u64,
    /// Width of a bin, um.
    pub resolution_um: u32,
    /// Range of bin 0, um.
    pub offset_um: i32,
    /// The values' bytes.
    pub values: &'a [u8],
}

/// Why a datagram is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Another protocol's.
    Foreign,
    /// Of a version that is not known.
    Version,
    /// The checksum is wrong, or it is cut.
    Damaged,
    /// It contradicts itself.
    Senseless,
}

impl<'a> Packet<'a> {
    /// Reads a datagram.
    pub fn decode(datagram: &'a [u8]) -> Result<Self, Refusal> {
        let mut bytes = Bytes(datagram);
        if bytes.array() != Some(MAGIC) {
            return Err(Refusal::Foreign);
        }
        if bytes.u8() != Some(VERSION) {
            return Err(Refusal::Version);
        }
        let (body, crc) = datagram.split_last_chunk().ok_or(Refusal::Damaged)?;
        if crc32c(body) != u32::from_le_bytes(*crc) {
            return Err(Refusal::Damaged);
        }
        Self::fields(Bytes(body)).ok_or(Refusal::Senseless)
    }

    fn fields(mut bytes: Bytes<'a>) -> Option<Self> {
        let body = bytes.0;
        bytes.slice(MAGIC.len() + 1)?;
        let format = Format::from_code(bytes.u8()?)?;
        let header = usize::from(bytes.u16_le()?);
        let (device, sweep) = (bytes.u32_le()?, bytes.u32_le()?);
        let (beam, beams) = (bytes.u16_le()?, bytes.u16_le()?);
        let (fragment, fragments) = (bytes.u8()?, bytes.u8()?);
        let count = usize::from(bytes.u16_le()?);
        let packet = Self {
            format,
            device,
            sweep,
            beam,
            beams,
            fragment,
            fragments,
            first_bin: bytes.u16_le()?,
            flags: bytes.u16_le()?,
            azimuth: bytes.u32_le()?,
            device_ns: bytes.array().map(u64::from_le_bytes)?,
            resolution_um: bytes.u32_le()?,
            offset_um: bytes.array().map(i32::from_le_bytes)?,
            values: body.get(header..)?,
        };
        let fits = header >= HEADER_BYTES
            && beam < beams
            && fragment < fragments
            && packet.resolution_um > 0
            && packet.values.len() == count * format.width()
            && (format == Format::Sparse || usize::from(packet.first_bin) + count <= 1 << 16);
        fits.then_some(packet)
    }

    /// Writes the datagram, anew into `out`.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let count = (self.values.len() / self.format.width()) as u16;
        out.clear();
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&[VERSION, self.format.code()]);
        out.extend_from_slice(&(HEADER_BYTES as u16).to_le_bytes());
        out.extend_from_slice(&self.device.to_le_bytes());
        out.extend_from_slice(&self.sweep.to_le_bytes());
        out.extend_from_slice(&self.beam.to_le_bytes());
        out.extend_from_slice(&self.beams.to_le_bytes());
        out.extend_from_slice(&[self.fragment, self.fragments]);
        for number in [count, self.first_bin, self.flags] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        out.extend_from_slice(&self.azimuth.to_le_bytes());
        out.extend_from_slice(&self.device_ns.to_le_bytes());
        out.extend_from_slice(&self.resolution_um.to_le_bytes());
        out.extend_from_slice(&self.offset_um.to_le_bytes());
        out.extend_from_slice(self.values);
        out.extend_from_slice(&crc32c(out).to_le_bytes());
    }

    /// Adds the returns above a floor; gives the number of the others.
    pub fn above(&self, keep_power: f32, echoes: &mut Vec<Echo>) -> u32 {
        let mut dropped = 0;
        let mut keep = |bin: u16, intensity: f32| {
            if intensity > keep_power {
                echoes.push(Echo { bin, intensity });
            } else {
                dropped += 1;
            }
        };
        let values = self.values.chunks_exact(self.format.width());
        for (value, bin) in values.zip(usize::from(self.first_bin)..) {
            let mut bytes = Bytes(value);
            match self.format {
                Format::Dense8 => bytes.u8().map(|v| keep(bin as u16, f32::from(v) * 0.5)),
                Format::Dense16 => (bytes.u16_le()).map(|v| keep(bin as u16, f32::from(v) / 100.0)),
                Format::Sparse => {
                    let pair = bytes.u16_le().zip(bytes.array().map(i16::from_le_bytes));
                    pair.map(|(bin, v)| keep(bin, f32::from(v) / 10.0))
                }
            };
        }
        dropped
    }
}

/// Writes a value as a format does, to the nearest step of its range.
pub fn encode_value(format: Format, echo: Echo, out: &mut Vec<u8>) {
    // `as` keeps to the type's range.
    match format {
        Format::Dense8 => out.push((echo.intensity * 2.0).round() as u8),
        Format::Dense16 => {
            out.extend_from_slice(&((echo.intensity * 100.0).round() as u16).to_le_bytes());
        }
        Format::Sparse => {
            out.extend_from_slice(&echo.bin.to_le_bytes());
            out.extend_from_slice(&((echo.intensity * 10.0).round() as i16).to_le_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ours; docs/beam-udp.md prints it.
    const OURS: &str = "52424d3101023000 07000000 2a000000 0300 dc00 00 01 0200 0000 0000 7d80de03
        00c2eb0b00000000 e43e0000 00000000 0500 3c00 0a00 7800 efe3395e";

    pub(crate) fn hex(text: &str) -> Vec<u8> {
        let digits: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
        let byte = |pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
        digits.chunks(2).map(byte).collect()
    }

    #[test]
    fn the_documents_datagram_both_ways() {
        let packet = Packet {
            format: Format::Sparse,
            device: 7,
            sweep: 42,
            beam: 3,
            beams: 220,
            fragment: 0,
            fragments: 1,
            first_bin: 0,
            flags: 0,
            azimuth: 0x03de_807d,
            device_ns: 200_000_000,
            resolution_um: 16_100,
            offset_um: 0,
            values: &[5, 0, 60, 0, 10, 0, 120, 0],
        };
        let mut bytes = Vec::new();
        packet.encode(&mut bytes);
        let shown: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(bytes, hex(OURS), "{shown}");
        assert_eq!(Packet::decode(&bytes), Ok(packet));
        let mut echoes = Vec::new();
        assert_eq!(packet.above(6.0, &mut echoes), 1);
        let loud = Echo {
            bin: 10,
            intensity: 12.0,
        };
        assert_eq!(echoes, [loud]);
    }

    #[test]
    fn one_bit_anywhere_is_noticed() {
        let bytes = hex(OURS);
        for bit in 0..bytes.len() * 8 {
            let mut wrong = bytes.clone();
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert!(Packet::decode(&wrong).is_err(), "bit {bit}");
        }
        for end in 0..bytes.len() {
            assert!(Packet::decode(&bytes[..end]).is_err());
        }
    }

    proptest! {
        #[test]
        fn round_trip(
            numbers in any::<[u32; 5]>(),
            beam in 0..1024_u16,
            fragment in any::<u8>(),
            shorts in any::<[u16; 2]>(),
            device_ns in any::<u64>(),
            resolution_um in 1..u32::MAX,
            code in 0..3_u8,
            bytes in prop::collection::vec(any::<u8>(), 0..400),
        ) {
            let format = Format::from_code(code).unwrap();
            let packet = Packet {
                format,
                device: numbers[0],
                sweep: numbers[1],
                beam,
                beams: 1024,
                fragment: fragment.min(254),
                fragments: 255,
                first_bin: shorts[0].min(60_000),
                flags: shorts[1],
                azimuth: numbers[2],
                device_ns,
                resolution_um,
                offset_um: numbers[3] as i32,
                values: &bytes[..bytes.len() / format.width() * format.width()],
            };
            let mut datagram = Vec::new();
            packet.encode(&mut datagram);
            prop_assert_eq!(Packet::decode(&datagram), Ok(packet));
        }

        /// What is written is read to half a step.
        #[test]
        fn values(intensity in 0.0..120.0_f32, bin in any::<u16>(), code in 0..3_u8) {
            let format = Format::from_code(code).unwrap();
            let mut values = Vec::new();
            encode_value(format, Echo { bin, intensity }, &mut values);
            let packet = Packet {
                format, device: 0, sweep: 0, beam: 0, beams: 1, fragment: 0, fragments: 1, first_bin: bin, flags: 0,
                azimuth: 0, device_ns: 0, resolution_um: 1, offset_um: 0, values: &values,
            };
            let mut echoes = Vec::new();
            packet.above(-1.0, &mut echoes);
            prop_assert_eq!(echoes[0].bin, bin);
            prop_assert!((echoes[0].intensity - intensity).abs() <= 0.2501);
        }

        #[test]
        fn no_bytes_break_it(bytes in prop::collection::vec(any::<u8>(), 0..120)) {
            let mut datagram = [MAGIC.as_slice(), &[VERSION], &bytes].concat();
            let crc = crc32c(&datagram);
            datagram.extend_from_slice(&crc.to_le_bytes());
            if let Ok(packet) = Packet::decode(&datagram) {
                packet.above(0.0, &mut Vec::new());
            }
        }
    }
}
