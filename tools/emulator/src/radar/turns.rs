//! A log's sweeps as what a radar sends.

use crate::{Error, Recording};
use randt_messages::{Beam, Message, RadarScan, Return};
use std::f64::consts::TAU;

/// The sweeps of a recording, numbered.
pub(crate) struct Turns {
    recording: Recording<RadarScan>,
    number: u32,
    bins: usize,
    first_m: f64,
}

/// A sweep.
pub(crate) struct Turn {
    scan: Message<RadarScan>,
    shift_ns: i64,
    /// Its number since the beginning.
    pub number: u32,
    /// Beams that it should have.
    pub beams: u16,
    /// Bins of a beam: as many as the log has shown so far.
    pub bins: usize,
    /// Width of a bin, m.
    pub bin_m: f64,
    /// Range of bin 0, m.
    pub first_m: f64,
}

/// A beam.
pub(crate) struct TurnBeam<'a> {
    /// Its number in the sweep; those that the log lacks are left out.
    pub number: u16,
    pub stamp_ns: i64,
    /// Counter-clockwise.
    pub azimuth_rad: f64,
    pub returns: &'a [Return],
}

impl Turns {
    pub fn new(recording: Recording<RadarScan>) -> Self {
        Self {
            recording,
            number: 0,
            bins: 1,
            first_m: 0.0,
        }
    }

    pub fn next_turn(&mut self) -> Result<Option<Turn>, Error> {
        let Some((scan, shift_ns)) = self.recording.next_message()? else {
            return Ok(None);
        };
        let sweep = &scan.head.sweep;
        let bin_m = f64::from(sweep.range_resolution_m);
        let beams = (TAU / f64::from(sweep.azimuth_step_rad)).round();
        if let Some(item) = scan.items.first() {
            self.first_m = f64::from(item.range_m) - f64::from(item.bin) * bin_m;
        }
        let farthest = scan.items.iter().map(|item| item.bin).max();
        self.bins = self.bins.max(usize::from(farthest.unwrap_or(0)) + 1);
        self.number += 1;
        Ok(Some(Turn {
            shift_ns,
            number: self.number - 1,
            beams: (beams as u16).max(sweep.beam_count as u16),
            bins: self.bins,
            bin_m,
            first_m: self.first_m,
            scan,
        }))
    }
}

impl Turn {
    /// Angle between beams.
    pub fn step_rad(&self) -> f64 {
        TAU / f64::from(self.beams.max(1))
    }

    /// Time of the turn, ns.
    pub fn duration_ns(&self) -> i64 {
        let sweep = &self.scan.head.sweep;
        let share = f64::from(self.beams) / f64::from(sweep.beam_count.max(1));
        ((sweep.end_ns - sweep.begin_ns) as f64 * share) as i64
    }

    pub fn beams(&self) -> impl Iterator<Item = TurnBeam<'_>> {
        let sweep = &self.scan.head.sweep;
        let whole = sweep.beam_count as usize == usize::from(self.beams);
        let beam_rad = |beam: Option<&Beam>| beam.map_or(0.0, |b| f64::from(b.azimuth_rad));
        let first_rad = beam_rad(sweep.beams().first());
        let second_rad = beam_rad(sweep.beams().get(1));
        // The sense in which it turns.
        let rises = (second_rad - first_rad).rem_euclid(TAU) < TAU / 2.0;
        sweep.beams().iter().enumerate().map(move |(index, beam)| {
            let azimuth_rad = f64::from(beam.azimuth_rad);
            let turned_rad = match rises {
                true => azimuth_rad - first_rad,
                false => first_rad - azimuth_rad,
            };
            let steps = (turned_rad.rem_euclid(TAU) / self.step_rad()).round() as usize;
            let number = if whole { index } else { steps };
            let returns = sweep.returns_of(index, self.scan.items.len());
            TurnBeam {
                number: number.min(usize::from(self.beams) - 1) as u16,
                stamp_ns: beam.stamp_ns + self.shift_ns,
                azimuth_rad,
                returns: self.scan.items.get(returns).unwrap_or_default(),
            }
        })
    }
}
