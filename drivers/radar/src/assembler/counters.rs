//! What an assembler counts, and what makes it doubt a sweep.

use randt_device::Count;

/// Late beams, as a share of a sweep's, above which somebody has sent its beams before the radar did: networks make a
/// beam late at times.
const LATE_SHARE: u64 = 8;

/// Beams and sweeps, and what became of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counters {
    pub beams: u64,
    pub sweeps: u64,
    pub partial: u64,
    pub lost: u64,
    pub late: u64,
    pub doubled: u64,
    pub reordered: u64,
    pub discarded: u64,
    pub before: u64,
    pub below_floor: u64,
    pub over_limit: u64,
    pub by_arrival: u64,
    pub by_period: u64,
    pub anew: u64,
    pub pauses: u64,
    pub contradicted: u64,
    pub contested: u64,
    pub clock_restarts: u64,
}

/// What was heard since the last sweep that makes the next one doubtful.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Doubts {
    pub strangers: u64,
    pub contradicted: u64,
    pub late: u64,
}

impl Counters {
    /// Goes on where another one ends.
    pub fn add(&mut self, more: &Self) {
        let Self {
            beams,
            sweeps,
            partial,
            lost,
            late,
            doubled,
            reordered,
            discarded,
            before,
            below_floor,
            over_limit,
            by_arrival,
            by_period,
            anew,
            pauses,
            contradicted,
            contested,
            clock_restarts,
        } = more;
        for (to, more) in [
            (&mut self.beams, beams),
            (&mut self.sweeps, sweeps),
            (&mut self.partial, partial),
            (&mut self.lost, lost),
            (&mut self.late, late),
            (&mut self.doubled, doubled),
            (&mut self.reordered, reordered),
            (&mut self.discarded, discarded),
            (&mut self.before, before),
            (&mut self.below_floor, below_floor),
            (&mut self.over_limit, over_limit),
            (&mut self.by_arrival, by_arrival),
            (&mut self.by_period, by_period),
            (&mut self.anew, anew),
            (&mut self.pauses, pauses),
            (&mut self.contradicted, contradicted),
            (&mut self.contested, contested),
            (&mut self.clock_restarts, clock_restarts),
        ] {
            *to += more;
        }
    }

    /// Tells all of them; the clock counts its restarts itself.
    pub fn tell(&self, clock_restarts: u64, tell: &mut dyn FnMut(Count)) {
        tell(Count::event("sweeps", self.sweeps));
        tell(Count::event("sweeps_partial", self.partial));
        tell(Count::event("beams", self.beams));
        tell(Count::loss("beams_lost", self.lost));
        tell(Count::loss("beams_late", self.late));
        tell(Count::event("beams_doubled", self.doubled));
        tell(Count::event("beams_contradicted", self.contradicted));
        tell(Count::event("sweeps_contested", self.contested));
        tell(Count::event("beams_reordered", self.reordered));
        tell(Count::loss(
            "beams_of_less_than_half_a_sweep",
            self.discarded,
        ));
        tell(Count::event("beams_before_the_first_sweep", self.before));
        tell(Count::event("sequence_anew", self.anew));
        tell(Count::event("pauses", self.pauses));
        tell(Count::event(
            "clock_restarts",
            self.clock_restarts + clock_restarts,
        ));
        tell(Count::event("sweeps_timed_by_arrival", self.by_arrival));
        tell(Count::event("sweeps_timed_by_period", self.by_period));
        tell(Count::event("returns_below_floor", self.below_floor));
        tell(Count::loss("returns_over_limit", self.over_limit));
    }
}

impl Doubts {
    /// Whether a sweep of so many beams is contested by them.
    pub fn are_grave(&self, beams: u16) -> bool {
        self.strangers > 0 || self.contradicted > 0 || LATE_SHARE * self.late > u64::from(beams)
    }
}
