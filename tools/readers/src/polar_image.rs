//! A polar image: one row an azimuth, one byte of power a range bin.
//!
//! Oxford's and Boreas' rows begin with 11 bytes: i64 little-endian time (us, later ns), u16
//! little-endian encoder, u8 validity (255: measured). MulRan's and RADIATE's images have the
//! powers alone, one column an azimuth. Powers are in 0.5 dB.

mod png;
mod sweep;

use crate::limit::is_instant;
use randt_messages::MAX_BEAMS;

pub(crate) use sweep::{RangeBins, build};

/// Metadata before the powers.
const METADATA_BYTES: usize = 11;
/// Most plausible bins: a Navtech has up to 11,000 (500 m at 0.044 m).
const BINS_MAX: usize = 16_384;
/// Longest plausible sweep, s; Navtech radars turn in 0.25 s.
const SWEEP_MAX_NS: u64 = 5_000_000_000;
/// Counts of a Navtech's encoder in one turn: CTS and CIR, and the RAS family.
const ENCODER_TURNS: [u16; 2] = [5600, 16_000];
/// A row's time above this is in ns: in us it would be the year 5138.
const MICROSECONDS_MAX: i64 = 100_000_000_000_000_000;

/// One azimuth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<'a> {
    /// In the image's ticks.
    pub time: i64,
    /// Clockwise from x (forward), in counts.
    pub encoder: u16,
    pub powers: &'a [u8],
}

/// When and where a row was measured; `None` where it was not.
#[derive(Clone, Copy, Debug)]
struct RowHead {
    time: i64,
    encoder: u16,
    valid: bool,
}

/// A decoded image.
#[derive(Debug)]
pub(crate) struct PolarImage {
    bins: usize,
    heads: Vec<RowHead>,
    powers: Vec<u8>,
    /// Encoder counts in a turn.
    turn: u16,
    /// Unit of the rows' times.
    ns_per_tick: i64,
    has_times: bool,
}

impl PolarImage {
    /// Reads pixels of 8 bits, row by row; the error has what is there instead of a polar sweep.
    pub fn from_pixels(pixels: Vec<u8>, width: usize, height: usize) -> Result<Self, String> {
        match Self::with_metadata(&pixels, width, height) {
            Ok(image) => Ok(image),
            // A sweep of powers alone has as many azimuths as a Navtech: 400. A photograph has not.
            Err(_) if height == AZIMUTHS && width <= BINS_MAX => {
                Ok(Self::evenly(pixels, width, height))
            }
            Err(_) if width == AZIMUTHS && height <= BINS_MAX => {
                let columns = (0..width).flat_map(|x| (0..height).map(move |y| y * width + x));
                let turned = columns.map(|at| pixels.get(at).copied().unwrap_or_default());
                Ok(Self::evenly(turned.collect(), height, width))
            }
            Err(why) => Err(why),
        }
    }

    /// Rows of one sweep in order: time ns, encoder, powers. `turn`: the encoder's counts in a
    /// turn, where that is known.
    pub fn from_rows(
        rows: impl Iterator<Item = (i64, u16)>,
        powers: Vec<u8>,
        bins: usize,
        turn: Option<u16>,
    ) -> Result<Self, String> {
        let head = |(time, encoder)| RowHead {
            time,
            encoder,
            valid: true,
        };
        let mut image = Self {
            bins,
            heads: rows.map(head).collect(),
            powers,
            turn: turn.unwrap_or(u16::MAX),
            ns_per_tick: 1,
            has_times: true,
        };
        image.check(turn)?;
        Ok(image)
    }

    /// Powers alone: azimuths at equal angles, the first one forward, clockwise.
    fn evenly(powers: Vec<u8>, bins: usize, azimuths: usize) -> Self {
        let head = |index: usize| RowHead {
            time: 0,
            encoder: index as u16,
            valid: true,
        };
        Self {
            bins,
            heads: (0..azimuths).map(head).collect(),
            powers,
            turn: azimuths as u16,
            ns_per_tick: 1,
            has_times: false,
        }
    }

    fn with_metadata(pixels: &[u8], width: usize, height: usize) -> Result<Self, String> {
        let widths = METADATA_BYTES + 1..=METADATA_BYTES + BINS_MAX;
        if !widths.contains(&width) || !(1..=MAX_BEAMS).contains(&height) {
            return Err(format!(
                "{width} x {height} pixels; a polar sweep has up to {MAX_BEAMS} rows, {METADATA_BYTES} bytes before the powers, or {AZIMUTHS} rows or columns of powers alone"
            ));
        }
        let bins = width - METADATA_BYTES;
        let (mut heads, mut powers) = (Vec::new(), Vec::with_capacity(height * bins));
        let rows = pixels.chunks_exact(width).filter_map(|row| {
            let (time, rest) = row.split_first_chunk::<8>()?;
            let (encoder, rest) = rest.split_first_chunk::<2>()?;
            let (valid, powers) = rest.split_first()?;
            let head = RowHead {
                time: i64::from_le_bytes(*time),
                encoder: u16::from_le_bytes(*encoder),
                valid: *valid == 255,
            };
            Some((head, powers))
        });
        for (head, row) in rows {
            heads.push(head);
            powers.extend_from_slice(row);
        }
        let is_ns = |head: &RowHead| head.valid && head.time > MICROSECONDS_MAX;
        let ns_per_tick = if heads.iter().any(is_ns) { 1 } else { 1000 };
        let mut image = Self {
            bins,
            heads,
            powers,
            turn: u16::MAX,
            ns_per_tick,
            has_times: true,
        };
        image.check(None)?;
        Ok(image)
    }

    /// Range bins of each row.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Whether its rows say when they were measured.
    pub fn has_times(&self) -> bool {
        self.has_times
    }

    /// Spreads the rows over a sweep that says nothing of their times.
    pub fn set_interval(&mut self, begin_ns: i64, end_ns: i64) {
        let count = self.heads.len().max(1) as i64;
        for (index, head) in (0_i64..).zip(&mut self.heads) {
            head.time = begin_ns + (end_ns - begin_ns) * (2 * index + 1) / (2 * count);
        }
        self.has_times = true;
    }

    /// The rows that were measured, in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let rows = self.heads.iter().zip(self.powers.chunks_exact(self.bins));
        rows.filter(|(head, _)| head.valid)
            .map(|(head, powers)| Row {
                time: head.time,
                encoder: head.encoder,
                powers,
            })
    }

    /// A grey photograph of the right depth is no sweep: its first bytes make no sense as times
    /// and angles. Finds the encoder's counts in a turn too.
    fn check(&mut self, turn: Option<u16>) -> Result<(), String> {
        let mut turns = turn.into_iter().chain(ENCODER_TURNS);
        let most = self.rows().map(|row| row.encoder).max();
        let turn = turns.find(|turn| most.is_some_and(|most| most < *turn));
        let unit = if self.ns_per_tick == 1 { "ns" } else { "us" };
        let mut first = None;
        for (index, row) in self.rows().enumerate() {
            let first = *first.get_or_insert(row.time);
            if !is_instant(row.time.saturating_mul(self.ns_per_tick)) {
                return Err(format!(
                    "row {index}: {} {unit}, which no measurement has; expected {unit} since 1970",
                    row.time
                ));
            }
            let apart = row.time.abs_diff(first);
            let apart_ns = apart.saturating_mul(self.ns_per_tick.unsigned_abs());
            if turn.is_none() || apart_ns > SWEEP_MAX_NS {
                let [turn, large] = ENCODER_TURNS;
                return Err(format!(
                    "row {index}: encoder {} and {} {unit} after the first row; a polar sweep has less than {turn} (or {large}) and 5 s",
                    row.encoder,
                    row.time.wrapping_sub(first)
                ));
            }
        }
        match (first, turn) {
            (Some(_), Some(turn)) => {
                self.turn = turn;
                Ok(())
            }
            _ => Err("no row is marked as measured (255 in its eleventh byte)".to_owned()),
        }
    }
}

/// Azimuths of a Navtech's turn.
const AZIMUTHS: usize = 400;
