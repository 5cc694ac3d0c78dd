//! Beams to sweeps.
//!
//! Responsible for which beam belongs to which sweep, for what is lost, doubled and late, and for when a sweep is whole.
//! Pure. Not responsible for a beam's bytes, nor for where sweeps go.

use crate::sweep::{Sweep, TURN};
use crate::timing::{TimedBy, Timing};
use crate::{Place, RawBeam};
use randt_device::{Count, DeviceClock};

/// Sweeps by which a number may go back before the sender must have begun anew.
const LATE_MAX: i64 = 2;
/// Sweeps by which a number may leap forward before the sender must have begun anew: minutes.
const LEAP_MAX: i64 = 1000;
/// Beams by which a running counter may go back: TCP keeps the order.
const BACK_MAX: i64 = 2;
/// Steps in one sense, less those in the other, after which a radar is believed to turn that way.
const TURNED: i64 = 4;

#[derive(Clone, Copy, Debug, Default)]
struct Counters {
    beams: u64,
    sweeps: u64,
    partial: u64,
    lost: u64,
    late: u64,
    doubled: u64,
    reordered: u64,
    discarded: u64,
    before: u64,
    below_floor: u64,
    over_limit: u64,
    by_arrival: u64,
    by_period: u64,
    anew: u64,
    pauses: u64,
}

/// A sweep that is collected.
#[derive(Debug)]
struct Open {
    id: i64,
    sweep: Sweep,
}

/// The last beam of a running counter.
#[derive(Clone, Copy, Debug)]
struct Running {
    number: i64,
    /// How far the radar has turned since the border of the first sweep.
    unwrapped: i64,
}

/// The last beam that came.
#[derive(Clone, Copy, Debug)]
struct Last {
    number: i64,
    device_ns: Option<i64>,
    arrival_ns: i64,
}

/// Collects beams and gives whole sweeps. In steady state it allocates nothing.
#[derive(Debug)]
pub struct Assembler {
    /// Time of a turn where the radar does not say it, ns.
    turn_ns: i64,
    clock: DeviceClock,
    current: Option<Open>,
    /// A beam of the next sweep may overtake the current one's last.
    next: Option<Open>,
    finished: Sweep,
    /// Sweeps that are not in use.
    spare: Vec<Sweep>,
    /// The last sweep that was given, or passed over; `None` until one begins.
    done: Option<i64>,
    /// The sweep in whose midst the first beam was.
    cut: Option<i64>,
    running: Option<Running>,
    last: Option<Last>,
    /// In which sense a running counter's azimuths go: 1 they rise, -1 they fall.
    sense: i64,
    turned: i64,
    azimuth: Option<u32>,
    beams: u16,
    /// Beams below this number are in a sweep or counted as lost.
    accounted: i64,
    counters: Counters,
}

impl Assembler {
    /// `turn_ns` is the time of a turn where the radar does not say it.
    pub fn new(turn_ns: i64) -> Self {
        Self {
            turn_ns: turn_ns.max(1),
            clock: DeviceClock::default(),
            current: None,
            next: None,
            finished: Sweep::default(),
            spare: vec![Sweep::default(), Sweep::default()],
            done: None,
            cut: None,
            running: None,
            last: None,
            sense: 1,
            turned: 0,
            azimuth: None,
            beams: 0,
            accounted: 0,
            counters: Counters::default(),
        }
    }

    /// Takes a beam; hands out the sweep that it makes whole.
    pub fn push(&mut self, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) {
        self.counters.beams += 1;
        if beam.layout.beams != self.beams {
            self.restart(whole);
            self.beams = beam.layout.beams;
        }
        if self.turns_round(beam) {
            self.restart(whole);
        }
        let (mut id, mut number) = self.locate(beam);
        if self.begins_anew(id, number) {
            self.counters.anew += 1;
            self.restart(whole);
            (id, number) = self.locate(beam);
        }
        if self.was_paused(beam, number) {
            self.counters.pauses += 1;
            self.restart(whole);
            (id, number) = self.locate(beam);
        }
        self.last = Some(Last {
            number,
            device_ns: beam.device_ns,
            arrival_ns: beam.arrival_ns,
        });
        if let Place::Running(_) = beam.place {
            let unwrapped = id * TURN + i64::from(self.past_border(beam));
            self.running = Some(Running { number, unwrapped });
        }
        if self.done.is_none() && !self.begin(beam, id, number) {
            self.counters.before += 1;
            return;
        }
        self.take(beam, id, number, whole);
    }

    /// What comes next does not continue what was: gives what is collected, if it is half a sweep at least.
    pub fn restart(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        while self.current.is_some() {
            self.finish(true, whole);
        }
        self.last = None;
        self.done = None;
        self.cut = None;
        self.running = None;
        self.azimuth = None;
    }

    /// Tells all counters.
    pub fn counts(&self, tell: &mut dyn FnMut(Count)) {
        let counters = &self.counters;
        tell(Count::event("sweeps", counters.sweeps));
        tell(Count::event("sweeps_partial", counters.partial));
        tell(Count::event("beams", counters.beams));
        tell(Count::loss("beams_lost", counters.lost));
        tell(Count::loss("beams_late", counters.late));
        tell(Count::event("beams_doubled", counters.doubled));
        tell(Count::event("beams_reordered", counters.reordered));
        tell(Count::loss(
            "beams_of_less_than_half_a_sweep",
            counters.discarded,
        ));
        tell(Count::event(
            "beams_before_the_first_sweep",
            counters.before,
        ));
        tell(Count::event("sequence_anew", counters.anew));
        tell(Count::event("pauses", counters.pauses));
        tell(Count::event("clock_restarts", self.clock.restarts()));
        tell(Count::event("sweeps_timed_by_arrival", counters.by_arrival));
        tell(Count::event("sweeps_timed_by_period", counters.by_period));
        tell(Count::event("returns_below_floor", counters.below_floor));
        tell(Count::loss("returns_over_limit", counters.over_limit));
    }

    /// How far a beam of a running counter lies behind the border between two sweeps. That is half a step before the
    /// encoder's zero: many radars have a beam at zero, which an unsteady encoder puts on either side.
    fn past_border(&self, beam: &RawBeam) -> u32 {
        let step = TURN / i64::from(self.beams.max(1));
        (self.sense * i64::from(beam.azimuth) + step / 2) as u32
    }

    /// Watches in which sense azimuths go; `true` where it is another one than was believed.
    fn turns_round(&mut self, beam: &RawBeam) -> bool {
        if let Some(last) = self.azimuth.replace(beam.azimuth) {
            let step = beam.azimuth.wrapping_sub(last).cast_signed();
            self.turned = (self.turned + i64::from(step.signum())).clamp(-TURNED, TURNED);
        }
        let other = self.turned == -self.sense * TURNED;
        if other {
            self.sense = -self.sense;
        }
        other && matches!(beam.place, Place::Running(_))
    }

    /// Whose sweep a beam is, and its number in the stream.
    fn locate(&self, beam: &RawBeam) -> (i64, i64) {
        match beam.place {
            Place::Numbered { sweep, beam } => {
                let id = i64::from(sweep);
                (id, id * i64::from(self.beams) + i64::from(beam))
            }
            Place::Running(counter) => {
                let Some(last) = self.running else {
                    return (0, i64::from(counter));
                };
                let passed = i64::from(counter.wrapping_sub(last.number as u16).cast_signed());
                // How far the radar has turned meanwhile; its low bits are those of the azimuth that is expected.
                let expected = last.unwrapped + passed * (TURN / i64::from(self.beams.max(1)));
                let off = self
                    .past_border(beam)
                    .wrapping_sub(expected as u32)
                    .cast_signed();
                let unwrapped = expected + i64::from(off);
                (unwrapped.div_euclid(TURN), last.number + passed)
            }
        }
    }

    /// Whether numbers leap as only those of a sender that was started anew do.
    fn begins_anew(&self, id: i64, number: i64) -> bool {
        match (self.running, self.done.or(self.cut)) {
            (Some(last), _) => number < last.number - BACK_MAX,
            (None, Some(done)) => !(done - LATE_MAX..=done + LEAP_MAX).contains(&id),
            (None, None) => false,
        }
    }

    /// Whether the radar has stood still for a turn or more although it counts on: what it saw before is another sweep.
    fn was_paused(&self, beam: &RawBeam, number: i64) -> bool {
        let Some(last) = self.last else {
            return false;
        };
        let turn_ns = beam.layout.turn_ns.unwrap_or(self.turn_ns);
        let steps = number.saturating_sub(last.number).max(0);
        let step_ns = turn_ns / i64::from(self.beams.max(1));
        let longest_ns = turn_ns.saturating_add(steps.saturating_mul(step_ns));
        let paused = |now_ns: i64, then_ns: i64| now_ns.saturating_sub(then_ns) > longest_ns;
        // A host that was busy sees it in the arrivals alone, a clock that was set in the stamps alone.
        let by_device = beam.device_ns.zip(last.device_ns);
        by_device.is_none_or(|(now, then)| paused(now, then))
            && paused(beam.arrival_ns, last.arrival_ns)
    }

    /// Whether a sweep begins here, so that what comes from now on is collected.
    fn begin(&mut self, beam: &RawBeam, id: i64, number: i64) -> bool {
        let cut = *self.cut.get_or_insert(id);
        match beam.place {
            Place::Numbered { beam, .. } => {
                self.begin_at(beam == 0 || id > cut, id, id * i64::from(self.beams))
            }
            Place::Running(_) => {
                let step = TURN / i64::from(self.beams.max(1));
                let known = self.turned == self.sense * TURNED;
                let at_begin = i64::from(self.past_border(beam)) < step;
                self.begin_at((at_begin || id > cut) && known, id, number)
            }
        }
    }

    fn begin_at(&mut self, begins: bool, id: i64, first: i64) -> bool {
        if begins {
            self.done = Some(id - 1);
            self.accounted = first;
        }
        begins
    }

    fn take(&mut self, beam: &RawBeam, id: i64, number: i64, whole: &mut dyn FnMut(&Sweep)) {
        loop {
            let current = self.current.as_ref().map(|open| open.id);
            if self.done.is_some_and(|done| id <= done) || current.is_some_and(|now| id < now) {
                let doubled = self.finished.has(number);
                let counter = if doubled {
                    &mut self.counters.doubled
                } else {
                    &mut self.counters.late
                };
                *counter += 1;
                return;
            }
            match current {
                None => self.current = Some(self.open(beam, id)),
                Some(now) if now == id => break,
                Some(_) if self.next.is_none() => {
                    let mut next = self.open(beam, id);
                    self.add(&mut next.sweep, beam, number);
                    self.next = Some(next);
                    return;
                }
                Some(_) => self.finish(false, whole),
            }
        }
        let Some(mut open) = self.current.take() else {
            return;
        };
        self.add(&mut open.sweep, beam, number);
        let is_whole = self.is_whole(&open.sweep, beam);
        self.current = Some(open);
        if is_whole {
            self.finish(false, whole);
        }
    }

    fn open(&mut self, beam: &RawBeam, id: i64) -> Open {
        let mut sweep = self.spare.pop().unwrap_or_default();
        sweep.begin(beam.layout);
        Open { id, sweep }
    }

    fn add(&mut self, sweep: &mut Sweep, beam: &RawBeam, number: i64) {
        let reordered = sweep.is_past(number);
        if sweep.has(number) {
            self.counters.doubled += 1;
        } else if !sweep.add(beam, number) {
            self.counters.lost += 1;
        } else if reordered {
            self.counters.reordered += 1;
        }
    }

    /// Whether no beam can be missing any more. A running counter's sweep ends where the next step, even a short one,
    /// passes the border.
    fn is_whole(&self, sweep: &Sweep, beam: &RawBeam) -> bool {
        let all = sweep.beams() >= usize::from(self.beams);
        let at_end = match beam.place {
            Place::Numbered { .. } => true,
            Place::Running(_) => {
                let step = TURN / i64::from(self.beams.max(1));
                i64::from(self.past_border(beam)) + step * 3 / 4 >= TURN
            }
        };
        all && at_end
    }

    /// Gives the current sweep; one that is cut lacks what was to come of its turn.
    fn finish(&mut self, cut: bool, whole: &mut dyn FnMut(&Sweep)) {
        let Some(Open { id, mut sweep }) = self.current.take() else {
            return;
        };
        self.current = self.next.take();
        // A running counter's sweep has every number up to the next one's first.
        let follower = self
            .current
            .as_ref()
            .and_then(|open| open.sweep.slots().first());
        let end = match (self.running, follower) {
            (None, _) => (id + 1) * i64::from(self.beams),
            (Some(_), Some(first)) => first.number,
            (Some(_), None) => sweep.newest() + 1,
        };
        let expected = end.saturating_sub(self.accounted).max(0);
        self.accounted = self.accounted.max(end);
        self.done = Some(id);
        let missing = expected.saturating_sub(sweep.beams() as i64).max(0);
        self.counters.lost += missing.unsigned_abs();
        // What a radar that has gone would have sent is missing in the sweep, but nobody has lost it.
        let whole_turn = if cut { i64::from(self.beams) } else { 0 };
        sweep.finish(expected.max(whole_turn));
        std::mem::swap(&mut self.finished, &mut sweep);
        self.spare.push(sweep);
        self.give(whole);
    }

    fn give(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        let sweep = &mut self.finished;
        let counters = &mut self.counters;
        // Nothing can be registered with less than half a turn.
        if 2 * sweep.beams() < usize::from(self.beams) {
            counters.discarded += sweep.beams() as u64;
            return;
        }
        let turn_ns = sweep.layout().turn_ns.unwrap_or(self.turn_ns);
        let timing = Timing::of(sweep.slots(), self.beams, turn_ns, &mut self.clock);
        sweep.timed(timing);
        counters.sweeps += 1;
        counters.partial += u64::from(sweep.beams_lost() > 0);
        counters.by_arrival += u64::from(timing.by == TimedBy::Arrival);
        counters.by_period += u64::from(timing.by == TimedBy::Period);
        counters.below_floor += u64::from(sweep.below_floor());
        counters.over_limit += u64::from(sweep.over_limit());
        whole(sweep);
    }
}

#[cfg(test)]
mod tests;
