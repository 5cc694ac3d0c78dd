//! What an assembler counts, and what makes it doubt a sweep.

use crate::counters::counters;

/// Late beams, as a share of a sweep's, above which another sender has sent its beams before the
/// radar did: networks make a beam late at times.
const LATE_SHARE: u64 = 8;

counters! {
    /// Beams and sweeps, and what happened to them. That many fields, because each kind of loss
    /// and doubt is reported by its own name.
    pub(super) struct Counters {
        sweeps: event "sweeps",
        partial: event "sweeps_partial",
        beams: event "beams",
        lost: loss "beams_lost",
        late: loss "beams_late",
        doubled: event "beams_doubled",
        contradicted: event "beams_contradicted",
        contested: event "sweeps_contested",
        reordered: event "beams_reordered",
        discarded: loss "beams_of_less_than_half_a_sweep",
        before: event "beams_before_the_first_sweep",
        anew: event "sequence_anew",
        pauses: event "pauses",
        clock_restarts: event "clock_restarts",
        by_arrival: event "sweeps_timed_by_arrival",
        by_period: event "sweeps_timed_by_period",
        below_floor: event "returns_below_floor",
        over_limit: loss "returns_over_limit",
    }
}

/// What came since the last sweep that makes the next one doubtful.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Doubts {
    pub other_senders: u64,
    pub contradicted: u64,
    pub late: u64,
}

impl Doubts {
    /// Whether a sweep of this many beams is contested by them.
    pub fn contest(&self, beams: u16) -> bool {
        self.other_senders > 0 || self.contradicted > 0 || LATE_SHARE * self.late > u64::from(beams)
    }
}
