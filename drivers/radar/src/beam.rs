//! A decoded beam, before its sweep is known.

use crate::Sender;

/// A beam's position in the stream, as far as a decoder knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeamPosition {
    /// A counter that rises by one from beam to beam; a sweep begins where the azimuth, which
    /// rises, begins anew.
    Running(u16),
    /// The number of the sweep and that of the beam in it, below the layout's `beams`.
    Numbered {
        /// Rises by one from sweep to sweep.
        sweep: u32,
        /// From 0.
        beam: u16,
    },
}

/// How a radar's beams lie.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeamLayout {
    /// Beams of a whole sweep, 3 to [`randt_messages::MAX_BEAMS`].
    pub beams: u16,
    /// Azimuths count clockwise, seen from above.
    pub clockwise: bool,
    /// Width of a range bin, m.
    pub bin_m: f64,
    /// Range of bin 0, m: of its middle.
    pub first_m: f64,
    /// Time of one turn as the radar gives it, ns.
    pub turn_ns: Option<i64>,
}

impl BeamLayout {
    /// Range of a bin, m.
    pub fn range_m(&self, bin: u16) -> f64 {
        self.first_m + f64::from(bin) * self.bin_m
    }
}

/// The echo of one range bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Echo {
    /// Range bin.
    pub bin: u16,
    /// In the sensor's own unit.
    pub intensity: f32,
}

/// One beam as it came. Decoders use one over and over, so that nothing is allocated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawBeam {
    /// Its sender.
    pub sender: Sender,
    /// Checksum of all its bytes: copies of a beam have the same. 0 where the connection makes no
    /// copies.
    pub fingerprint: u32,
    /// Copies of a part of it differed.
    pub contradicted: bool,
    /// Its position in the stream.
    pub position: BeamPosition,
    /// Direction as the radar counts it; 2^32 are one turn.
    pub azimuth: u32,
    /// The radar's own stamp, ns of its clock.
    pub device_ns: Option<i64>,
    /// When it reached the host, ns.
    pub arrival_ns: i64,
    /// How the beams lie.
    pub layout: BeamLayout,
    /// Echoes above the floor, nearest first.
    pub echoes: Vec<Echo>,
    /// Echoes at or below the floor, left out.
    pub dropped: u32,
    /// All bins in 0.5 dB, where they are to be recorded.
    pub powers: Vec<u8>,
}

impl Default for BeamPosition {
    fn default() -> Self {
        Self::Running(0)
    }
}
