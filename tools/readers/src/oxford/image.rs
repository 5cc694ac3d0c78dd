//! A polar image: one row an azimuth, 11 bytes of metadata, then one byte of power a range bin.
//!
//! Layout after the data set's documentation: i64 little-endian time us, u16 little-endian encoder
//! (5,600 counts a turn), u8 validity (255: measured), powers in 0.5 dB.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use crate::limit::is_instant;
use randt_messages::MAX_BEAMS;

/// Metadata before the powers.
const METADATA_BYTES: usize = 11;
/// Widest plausible row: a Navtech has up to 11,000 bins (500 m at 0.044 m).
const WIDTH_MAX: u32 = 16_384;
/// Longest plausible sweep, us; Navtech radars turn in 0.25 s.
const SWEEP_MAX_US: u64 = 5_000_000;
/// Counts of the encoder in one turn.
pub(super) const ENCODER_TURN: u16 = 5600;

/// One azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<'a> {
    pub time_us: i64,
    /// Clockwise from x (forward), in counts.
    pub encoder: u16,
    /// Whether it was measured, not filled in.
    pub valid: bool,
    pub powers: &'a [u8],
}

/// A decoded image.
#[derive(Debug)]
pub(super) struct PolarImage {
    width: usize,
    bytes: Vec<u8>,
}

impl PolarImage {
    /// Reads an image; the error has what is there instead of a polar sweep.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|error| error.to_string())?;
        Self::decode(BufReader::new(file))
    }

    pub fn decode(reader: impl std::io::BufRead + std::io::Seek) -> Result<Self, String> {
        let mut decoder = png::Decoder::new(reader);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
        let (width, height) = reader.info().size();
        let (color, depth) = reader.output_color_type();
        let fits = color == png::ColorType::Grayscale
            && depth == png::BitDepth::Eight
            && (METADATA_BYTES as u32 + 1..=WIDTH_MAX).contains(&width)
            && (1..=MAX_BEAMS as u32).contains(&height);
        if !fits {
            return Err(format!(
                "{width} x {height} pixels of {color:?} {depth:?}; a polar sweep has up to {MAX_BEAMS} rows of grey, 8 bit, {METADATA_BYTES} bytes before the powers"
            ));
        }
        let mut bytes = vec![0; width as usize * height as usize];
        reader
            .next_frame(&mut bytes)
            .map_err(|error| error.to_string())?;
        let image = Self {
            width: width as usize,
            bytes,
        };
        image.check()?;
        Ok(image)
    }

    /// The rows in the order of measurement.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.bytes.chunks_exact(self.width).filter_map(|row| {
            let (time, rest) = row.split_first_chunk::<8>()?;
            let (encoder, rest) = rest.split_first_chunk::<2>()?;
            let (valid, powers) = rest.split_first()?;
            Some(Row {
                time_us: i64::from_le_bytes(*time),
                encoder: u16::from_le_bytes(*encoder),
                valid: *valid == 255,
                powers,
            })
        })
    }

    /// A grey photograph of the right depth is no sweep: its first bytes make no sense as times
    /// and angles.
    fn check(&self) -> Result<(), String> {
        let mut first_us = None;
        for (index, row) in self.rows().enumerate().filter(|(_, row)| row.valid) {
            let first_us = *first_us.get_or_insert(row.time_us);
            if !is_instant(row.time_us.saturating_mul(1000)) {
                return Err(format!(
                    "row {index}: {} us, which no measurement has; expected us since 1970",
                    row.time_us
                ));
            }
            if row.encoder >= ENCODER_TURN || row.time_us.abs_diff(first_us) > SWEEP_MAX_US {
                return Err(format!(
                    "row {index}: encoder {} and {} us after the first row; a polar sweep has less than {ENCODER_TURN} and {SWEEP_MAX_US}",
                    row.encoder,
                    row.time_us.wrapping_sub(first_us)
                ));
            }
        }
        match first_us {
            Some(_) => Ok(()),
            None => Err("no row is marked as measured (255 in its eleventh byte)".to_owned()),
        }
    }
}
