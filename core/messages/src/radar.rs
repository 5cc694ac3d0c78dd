//! `radar/scan` and `radar/points`: one sweep of a rotating radar, whole and filtered.

use crate::{Header, layout::coded, plain};

/// Most beams in a sweep.
pub const MAX_BEAMS: usize = 1024;
/// Most returns in a sweep.
pub const MAX_RETURNS: usize = 65_536;

coded! {
    /// The sensor that made a sweep.
    pub enum SensorKind {
        /// The input does not say.
        #[default]
        Unknown = 0 => "unknown",
        /// indurad iSDR-C.
        IsdrC = 1 => "isdr-c",
        /// Navtech CTS or CIR series.
        NavtechCts = 2 => "navtech-cts",
    }
}

impl SensorKind {
    /// The kind that the configuration calls so; `Unknown` for any other.
    pub fn from_name(name: &str) -> Self {
        let kinds = [Self::IsdrC, Self::NavtechCts];
        let named = kinds.into_iter().find(|kind| kind.as_str() == name);
        named.unwrap_or_default()
    }

    /// What the configuration calls it; `None` where the input does not say.
    pub fn name(self) -> Option<&'static str> {
        (self != Self::Unknown).then_some(self.as_str())
    }
}

plain! {
    /// One beam of a sweep.
    pub struct Beam {
        /// When the beam was measured.
        pub stamp_ns: i64,
        /// Direction in the radar's frame, counter-clockwise from x, in [-pi, pi).
        pub azimuth_rad: f32,
        /// Index of its first return in the slice; its last is before the next beam's first.
        pub first_return: u32,
    }

    /// One return, the strongest echo of one range bin.
    pub struct Return {
        /// Distance from the radar.
        pub range_m: f32,
        /// Intensity in the sensor's own unit (iSDR-C: unstated; Navtech: 0.5 dB).
        pub intensity: f32,
        /// Index of its beam in the table.
        pub beam: u16,
        /// Range bin.
        pub bin: u16,
    }

    /// The fixed part of a sweep. Beams are in order of time, returns by beam, then range.
    pub struct SweepHead {
        /// First instant of the sweep.
        pub begin_ns: i64,
        /// Last instant of the sweep; the header's stamp.
        pub end_ns: i64,
        /// A [`SensorKind`] as its code.
        #[code(SensorKind)]
        pub sensor: u32,
        /// Beams in the table.
        pub beam_count: u32,
        /// Beams that should be here and are not.
        pub beams_lost: u32,
        /// Returns left out: under the driver's floor, not finite, or over the table's size.
        pub returns_dropped: u32,
        /// Width of a range bin.
        pub range_resolution_m: f32,
        /// Angle between neighbouring beams of the full sweep.
        pub azimuth_step_rad: f32,
        /// 1 where the beams may not all be the radar's: beams of another sender came meanwhile,
        /// or copies of a beam differed. Else 0.
        #[was_bit(sensor, 31)]
        pub contested: u64,
        /// The table; entries from `beam_count` on are zero.
        pub beams: [Beam; MAX_BEAMS],
    }

    /// Head of `radar/scan`.
    pub struct ScanHead {
        /// Stamp: the sweep's end.
        pub header: Header,
        /// Times, beams, counters.
        pub sweep: SweepHead,
    }

    /// Head of `radar/points`.
    pub struct PointsHead {
        /// Stamp: the sweep's end.
        pub header: Header,
        /// Sequence of the `radar/scan` that this was made of.
        pub scan_sequence: u64,
        /// Epoch of that scan: with its sequence it names the scan, however often it is filtered.
        pub scan_epoch: u64,
        /// When that scan was published, for diagnosis only.
        pub scan_published_ns: i64,
        /// Times, beams, counters; `first_return` counts in the filtered slice.
        pub sweep: SweepHead,
    }
}

impl SweepHead {
    /// Whether its beams may not all be the radar's.
    pub fn is_contested(&self) -> bool {
        self.contested != 0
    }

    /// The beams that are there.
    pub fn beams(&self) -> &[Beam] {
        let count = (self.beam_count as usize).min(MAX_BEAMS);
        self.beams.get(..count).unwrap_or_default()
    }

    /// The index range of a beam's returns in a slice of `total`; empty where the table is broken.
    pub fn returns_of(&self, beam: usize, total: usize) -> core::ops::Range<usize> {
        let first_of = |beam: usize| {
            let beam = self.beams().get(beam);
            beam.map_or(total, |beam| beam.first_return as usize)
                .min(total)
        };
        let (first, end) = (first_of(beam), first_of(beam + 1));
        first..end.max(first)
    }
}
