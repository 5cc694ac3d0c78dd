//! Sweeps with all their bins, as polar images in the format of the Oxford Radar RobotCar data
//! set, which `tools/readers` reads: one row a beam, 11 bytes before its powers. Pure: bytes in,
//! bytes out.

use crate::{BeamPosition, RawBeam, Sweep};
use std::collections::VecDeque;

/// Before a row's powers: i64 little-endian us, u16 little-endian encoder counts, 255 (measured).
const METADATA_BYTES: usize = 11;
/// Counts of the format's encoder in a turn.
const ENCODER_TURN: u64 = 5600;
/// Rows that wait for their sweep at most: one that is not given leaves its rows behind.
const ROWS_MAX: usize = 2048;

/// A polar image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PolarImage {
    /// Its first row's time, us: its name.
    pub stamp_us: i64,
    /// Bytes of a row.
    pub width: usize,
    /// The rows.
    pub bytes: Vec<u8>,
}

/// Beams on their way into an image.
#[derive(Debug, Default)]
pub struct DenseRows {
    /// By the beams' counter: azimuths come again with every turn.
    rows: VecDeque<(u16, Vec<u8>)>,
    spare: Vec<Vec<u8>>,
}

impl DenseRows {
    /// Takes the powers of a beam with a running counter.
    pub fn push(&mut self, beam: &RawBeam) {
        let BeamPosition::Running(counter) = beam.position else {
            return;
        };
        if self.rows.len() >= ROWS_MAX {
            self.drop_first();
        }
        let mut powers = self.spare.pop().unwrap_or_default();
        powers.clone_from(&beam.powers);
        self.rows.push_back((counter, powers));
    }

    /// The image of a sweep whose beams were taken; rows get the sweep's times.
    pub fn image(&mut self, sweep: &Sweep) -> PolarImage {
        let longest = self.rows.iter().map(|(_, powers)| powers.len()).max();
        let width = METADATA_BYTES + longest.unwrap_or(0);
        let mut image = PolarImage {
            stamp_us: 0,
            width,
            bytes: Vec::with_capacity(width * sweep.beams()),
        };
        for (counter, azimuth, stamp_ns) in sweep.beam_times() {
            let Some(at) = self.rows.iter().position(|(known, _)| *known == counter) else {
                continue;
            };
            let Some((_, powers)) = self.rows.remove(at) else {
                continue;
            };
            let stamp_us = stamp_ns.div_euclid(1000);
            if image.bytes.is_empty() {
                image.stamp_us = stamp_us;
                // Those before the first one are of no sweep, or of one that was not given.
                (0..at).for_each(|_| self.drop_first());
            }
            let counts = (u64::from(azimuth) * ENCODER_TURN + (1 << 31)) >> 32;
            let encoder = (counts % ENCODER_TURN) as u16;
            image.bytes.extend_from_slice(&stamp_us.to_le_bytes());
            image.bytes.extend_from_slice(&encoder.to_le_bytes());
            image.bytes.push(255);
            image.bytes.extend_from_slice(&powers);
            let rows = image.bytes.len().div_ceil(width);
            // A contour makes some beams shorter than others.
            image.bytes.resize(rows * width, 0);
            self.spare.push(powers);
        }
        image
    }

    fn drop_first(&mut self) {
        if let Some((_, powers)) = self.rows.pop_front() {
            self.spare.push(powers);
        }
    }
}
