//! What Navtech's ROS drivers publish: one message an azimuth, or a whole turn with its encoder and
//! times, and the radar's configuration.
//!
//! Two generations of these messages exist under one name: every number as an array of bytes in
//! network order, and plain numbers.

use super::polar::RosImage;
use super::wire::{Encoding, Malformed, RosHeader, Wire};
use crate::limit::is_instant;
use crate::polar_image::PolarImage;

/// `RadarFftDataMessage`: the powers of one azimuth.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fft {
    pub header: RosHeader,
    /// Clockwise, in counts of the encoder.
    pub encoder: u16,
    /// The radar's own clock, ns.
    pub device_ns: i64,
    pub powers: Vec<u8>,
}

/// An unsigned number in network order.
fn network(bytes: &[u8]) -> u64 {
    let number = bytes.iter().take(8);
    number.fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}

impl Fft {
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        Self::of_bytes(bytes, encoding).or_else(|_| Self::of_numbers(bytes, encoding))
    }

    fn of_bytes(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        let mut field = |length: usize| {
            let bytes = wire.bytes()?;
            match bytes.len() == length {
                true => Ok(bytes),
                false => Err(wire.malformed("a number of another length")),
            }
        };
        field(8)?; // angle, rad or degrees: the encoder has it exactly
        let encoder = network(field(2)?) as u16;
        field(2)?; // sweep counter
        let (seconds, nanos) = (network(field(4)?), network(field(4)?));
        Ok(Self {
            header,
            encoder,
            device_ns: device_ns(seconds, nanos),
            powers: wire.bytes()?.to_vec(),
        })
    }

    fn of_numbers(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let header = wire.header()?;
        wire.f64()?;
        let encoder = wire.u16()?;
        wire.u16()?;
        let (seconds, nanos) = (wire.u32()?, wire.u32()?);
        let powers = wire.bytes()?.to_vec();
        if powers.is_empty() {
            return Err(wire.malformed("an azimuth without powers"));
        }
        Ok(Self {
            header,
            encoder,
            device_ns: device_ns(seconds.into(), nanos.into()),
            powers,
        })
    }
}

fn device_ns(seconds: u64, nanos: u64) -> i64 {
    // Both come from 32 bits.
    seconds.cast_signed() * 1_000_000_000 + nanos.cast_signed()
}

/// `RadarBScanMsg`: a turn of a radar with the encoder and the time of each azimuth.
pub(crate) struct BScan {
    pub image: RosImage,
    encoders: Vec<u16>,
    times: Vec<u64>,
}

impl BScan {
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        let image = RosImage::read(&mut wire)?;
        let encoders = wire.sequence(2, Wire::u16)?;
        let times = wire.sequence(8, Wire::u64)?;
        if encoders.len() != image.height || times.len() != image.height {
            return Err(wire.malformed("as many encoder values and times as rows are expected"));
        }
        Ok(Self {
            image,
            encoders,
            times,
        })
    }

    /// Its polar image and the turn's stamp.
    pub fn polar_image(self) -> Result<PolarImage, String> {
        // In us, or in ns.
        let is_us = |time: &u64| *time < 100_000_000_000_000_000;
        let unit = if self.times.iter().all(is_us) {
            1000
        } else {
            1
        };
        let times = self.times.iter().map(|time| time.saturating_mul(unit));
        let times = times.map(|time| i64::try_from(time).unwrap_or(i64::MAX));
        let rows = times.zip(self.encoders);
        let turn = None;
        PolarImage::from_rows(rows, self.image.pixels, self.image.width, turn)
    }
}

/// `RadarConfigurationMessage`, as far as it matters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Configuration {
    pub encoder_turn: u16,
    /// Width of a range bin, m.
    pub bin_m: f64,
    /// Where the first bin begins, m.
    pub offset_m: f64,
}

impl Configuration {
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut found =
            Self::of_bytes(bytes, encoding).or_else(|_| Self::of_numbers(bytes, encoding))?;
        // In 0.1 mm, as the radar sends it, or in m.
        if found.bin_m > 1.0 {
            found.bin_m *= 1e-4;
        }
        if (0.001..1.0).contains(&found.bin_m) && found.encoder_turn > 0 {
            return Ok(found);
        }
        let wire = Wire::new(bytes, encoding)?;
        Err(wire.malformed(format!(
            "bins of {} m, {} counts a turn",
            found.bin_m, found.encoder_turn
        )))
    }

    fn of_bytes(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        let mut wire = Wire::new(bytes, encoding)?;
        wire.header()?;
        let (azimuths, encoder, bin) = (wire.bytes()?, wire.bytes()?, wire.bytes()?);
        if (azimuths.len(), encoder.len()) != (2, 2) {
            return Err(wire.malformed("a number of another length"));
        }
        let bin_m = match *bin {
            [_, _, _, _] => f64::from(f32::from_bits(network(bin) as u32)),
            [_, _, _, _, _, _, _, _] => f64::from_bits(network(bin)),
            _ => network(bin) as f64,
        };
        Ok(Self {
            encoder_turn: network(encoder) as u16,
            bin_m,
            offset_m: 0.0,
        })
    }

    fn of_numbers(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        // The user's offset of the azimuth came later.
        let read = |has_azimuth_offset: bool| {
            let mut wire = Wire::new(bytes, encoding)?;
            wire.header()?;
            wire.u16()?;
            let encoder_turn = wire.u16()?;
            if has_azimuth_offset {
                wire.u16()?;
            }
            let bin = f64::from(wire.f32()?);
            wire.u16()?;
            wire.u16()?;
            let (gain, offset_m) = match (wire.f32(), wire.f32()) {
                (Ok(gain), Ok(offset)) => (f64::from(gain), f64::from(offset)),
                _ => (1.0, 0.0),
            };
            let gain = if (0.5..2.0).contains(&gain) {
                gain
            } else {
                1.0
            };
            let offset_m = if offset_m.abs() < 10.0 { offset_m } else { 0.0 };
            Ok(Self {
                encoder_turn,
                bin_m: bin * gain,
                offset_m,
            })
        };
        let is_plausible = |found: &Self| (0.001..10_000.0).contains(&found.bin_m);
        read(true)
            .ok()
            .filter(is_plausible)
            .map_or_else(|| read(false), Ok)
    }
}

/// Azimuths of a turn that is not over.
#[derive(Debug, Default)]
pub(crate) struct FftTurn {
    frame: String,
    rows: Vec<(i64, u16)>,
    powers: Vec<u8>,
    bins: usize,
}

/// More azimuths than a radar has: its encoder stands still.
const AZIMUTHS_MAX: usize = 1024;

impl FftTurn {
    /// Adds an azimuth; gives the turn before, with its frame, where this one begins the next.
    pub fn push(
        &mut self,
        fft: &Fft,
        encoder_turn: Option<u16>,
    ) -> Option<(String, Result<PolarImage, String>)> {
        let begins = self
            .rows
            .last()
            .is_some_and(|(_, last)| fft.encoder < *last);
        let is_other = fft.powers.len() != self.bins || self.rows.len() >= AZIMUTHS_MAX;
        let whole = (begins || is_other)
            .then(|| self.take(encoder_turn))
            .flatten();
        if self.rows.is_empty() {
            self.frame.clone_from(&fft.header.frame);
            self.bins = fft.powers.len();
        }
        // The host's clock is the IMU's too.
        let host_ns = fft.header.stamp_ns;
        let stamp_ns = match host_ns > 0 && is_instant(host_ns) {
            true => host_ns,
            false => fft.device_ns,
        };
        self.rows.push((stamp_ns, fft.encoder));
        self.powers.extend_from_slice(&fft.powers);
        whole
    }

    /// What there is of the turn.
    pub fn take(
        &mut self,
        encoder_turn: Option<u16>,
    ) -> Option<(String, Result<PolarImage, String>)> {
        let turn = std::mem::take(self);
        if turn.rows.len() < 2 || turn.bins == 0 {
            return None;
        }
        let rows = turn.rows.into_iter();
        let image = PolarImage::from_rows(rows, turn.powers, turn.bins, encoder_turn);
        Some((turn.frame, image))
    }
}
