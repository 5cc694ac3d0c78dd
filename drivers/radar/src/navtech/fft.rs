//! One beam of a Navtech.
//!
//! Source: IASDK (MIT), `FFT_data` and `High_precision_FFT_data` in C++ and Python; the scale of
//! 16 bits from its `FFT_types.h`.

use crate::Echo;
use crate::bytes::Bytes;

/// Bytes before the bins today; the message has their number.
pub const DATA_OFFSET: u16 = 14;
/// Most plausible bins: a Navtech has up to 11,000 (500 m at 0.044 m).
pub const BINS_MAX: usize = 16_384;
/// One step of 16 bits in the unit of 8 bits, 0.5 dB. By the vendor's documentation: fixed point
/// with 8 binary places, whose full scale of 141.5 stands for 96.5 dB.
pub const STEP_16: f32 = 2.0 / 256.0 * 96.5 / 141.5;

/// A beam's powers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bins<'a> {
    /// 0.5 dB each.
    Eight(&'a [u8]),
    /// Pairs of bytes, the highest first, [`STEP_16`] each.
    Sixteen(&'a [u8]),
}

/// A beam's message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fft<'a> {
    /// Rises by one from beam to beam.
    pub counter: u16,
    /// Counts of the encoder, clockwise.
    pub azimuth: u16,
    /// Seconds and nanoseconds, in an order of bytes that the vendor's programs disagree on.
    pub time: [u8; 8],
    /// Powers from bin 0 on.
    pub bins: Bins<'a>,
}

impl<'a> Fft<'a> {
    /// Reads a message's body; `None` where it is short, odd or has more bins than any radar.
    pub fn decode(payload: &'a [u8], sixteen: bool) -> Option<Self> {
        let mut bytes = Bytes(payload);
        let offset = bytes.u16_be()?;
        let counter = bytes.u16_be()?;
        let azimuth = bytes.u16_be()?;
        let time = bytes.array()?;
        let powers = payload.get(usize::from(offset)..)?;
        let (bins, count) = if sixteen {
            (Bins::Sixteen(powers), powers.len() / 2)
        } else {
            (Bins::Eight(powers), powers.len())
        };
        let whole = offset >= DATA_OFFSET && (!sixteen || powers.len() % 2 == 0);
        (whole && count <= BINS_MAX).then_some(Self {
            counter,
            azimuth,
            time,
            bins,
        })
    }

    /// Appends a message's body.
    pub fn encode(&self, out: &mut Vec<u8>) {
        for number in [DATA_OFFSET, self.counter, self.azimuth] {
            out.extend_from_slice(&number.to_be_bytes());
        }
        out.extend_from_slice(&self.time);
        let (Bins::Eight(powers) | Bins::Sixteen(powers)) = self.bins;
        out.extend_from_slice(powers);
    }
}

impl Bins<'_> {
    /// How many.
    pub fn count(&self) -> usize {
        match self {
            Self::Eight(powers) => powers.len(),
            Self::Sixteen(powers) => powers.len() / 2,
        }
    }

    /// Adds the bins above a power, in units of 0.5 dB; gives the number of the others.
    pub fn above(&self, keep_power: f32, echoes: &mut Vec<Echo>) -> u32 {
        let before = echoes.len();
        match self {
            Self::Eight(powers) => above_8(powers, keep_power, echoes),
            Self::Sixteen(powers) => {
                echoes.extend(powers.chunks_exact(2).zip(0..).filter_map(|(pair, bin)| {
                    let step = Bytes(pair).u16_be()?;
                    let intensity = f32::from(step) * STEP_16;
                    (intensity > keep_power).then_some(Echo { bin, intensity })
                }));
            }
        }
        self.count().saturating_sub(echoes.len() - before) as u32
    }

    /// Adds all of them, in 0.5 dB.
    pub fn all(&self, powers: &mut Vec<u8>) {
        match self {
            Self::Eight(bins) => powers.extend_from_slice(bins),
            Self::Sixteen(bins) => powers.extend(bins.chunks_exact(2).map(|pair| {
                let step = Bytes(pair).u16_be().unwrap_or(0);
                (f32::from(step) * STEP_16).round() as u8
            })),
        }
    }
}

/// Bins that are compared at once: most of them are noise, and the compiler compares this many in
/// one instruction or two.
const LANES: usize = 32;

fn above_8(powers: &[u8], keep_power: f32, echoes: &mut Vec<Echo>) {
    // Whole numbers: above 59.5 is above 59.
    let floor = keep_power.clamp(0.0, 255.0) as u8;
    let mut first = 0_usize;
    for chunk in powers.chunks(LANES) {
        if chunk.iter().fold(0, |max, power| *power.max(&max)) > floor {
            let loud = chunk
                .iter()
                .zip(first..)
                .filter(|(power, _)| **power > floor);
            echoes.extend(loud.map(|(power, bin)| Echo {
                bin: bin as u16,
                intensity: f32::from(*power),
            }));
        }
        first += LANES;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ours, after the Python of IASDK (`fft_message_8_bit.py`): big-endian but for the time.
    const OURS_8: [u8; 18] = [
        0, 14, 0x12, 0x34, 0x15, 0xd2, 1, 2, 3, 4, 5, 6, 7, 8, 10, 60, 61, 255,
    ];

    #[test]
    fn eight_bits_both_ways() {
        let fft = Fft::decode(&OURS_8, false).unwrap();
        assert_eq!((fft.counter, fft.azimuth), (0x1234, 5586));
        assert_eq!(fft.time, [1, 2, 3, 4, 5, 6, 7, 8]);
        let mut echoes = Vec::new();
        assert_eq!(fft.bins.above(60.0, &mut echoes), 2);
        let found: Vec<(u16, f32)> = echoes.iter().map(|e| (e.bin, e.intensity)).collect();
        assert_eq!(found, [(2, 61.0), (3, 255.0)]);
        let mut bytes = Vec::new();
        fft.encode(&mut bytes);
        assert_eq!(bytes, OURS_8);
    }

    #[test]
    fn the_data_offset_is_obeyed() {
        let mut longer = OURS_8.to_vec();
        longer[1] = 16;
        longer.splice(14..14, [0, 0]);
        let fft = Fft::decode(&longer, false).unwrap();
        assert_eq!(fft.bins, Bins::Eight(&[10, 60, 61, 255]));
        for wrong in [0, 13, 200] {
            longer[1] = wrong;
            assert_eq!(Fft::decode(&longer, false), None);
        }
    }

    #[test]
    fn sixteen_bits_have_the_unit_of_eight() {
        // 96.5 dB are 193 half decibels, at a fixed-point value of 141.5.
        let full = (141.5_f32 * 256.0) as u16;
        let powers = full.to_be_bytes();
        let mut echoes = Vec::new();
        Bins::Sixteen(&powers).above(0.0, &mut echoes);
        assert!((echoes[0].intensity - 193.0).abs() < 1e-3);
        assert_eq!(Fft::decode(&OURS_8[..17], true), None, "odd");
    }

    proptest! {
        #[test]
        fn round_trip(
            counter in any::<u16>(),
            azimuth in any::<u16>(),
            time in any::<[u8; 8]>(),
            powers in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let fft = Fft { counter, azimuth, time, bins: Bins::Eight(&powers) };
            let mut bytes = Vec::new();
            fft.encode(&mut bytes);
            prop_assert_eq!(Fft::decode(&bytes, false), Some(fft));
        }

        /// The fast way finds what the plain one does.
        #[test]
        fn lanes_lose_nothing(powers in prop::collection::vec(any::<u8>(), 0..200), floor in 0.0..255.0_f32) {
            let mut echoes = Vec::new();
            let dropped = Bins::Eight(&powers).above(floor, &mut echoes);
            let plain: Vec<Echo> = powers.iter().zip(0..)
                .filter(|(power, _)| f32::from(**power) > floor)
                .map(|(power, bin)| Echo { bin, intensity: f32::from(*power) })
                .collect();
            prop_assert_eq!(dropped as usize, powers.len() - plain.len());
            prop_assert_eq!(echoes, plain);
        }

        #[test]
        fn no_bytes_break_it(bytes in prop::collection::vec(any::<u8>(), 0..60), sixteen in any::<bool>()) {
            if let Some(fft) = Fft::decode(&bytes, sixteen) {
                fft.bins.above(0.0, &mut Vec::new());
            }
        }
    }
}
