//! Beams to sweeps.
//!
//! Responsible for what is lost, doubled and late, and for when a sweep is whole; `locator` knows
//! which beam belongs to which sweep. Pure. Not responsible for a beam's bytes, nor for where
//! sweeps go.

mod counters;
mod locator;

use crate::sweep::{Sweep, TURN};
use crate::timing::{TimedBy, Timing};
use crate::{BeamLayout, BeamPosition, RawBeam};
use counters::{Counters, Doubts};
use locator::BeamLocator;
use randt_device::{Count, DeviceClock};

/// A sweep that is collected.
#[derive(Debug)]
struct OpenSweep {
    id: i64,
    sweep: Sweep,
}

/// Collects beams and gives whole sweeps. In steady state it allocates nothing.
#[derive(Debug)]
pub struct Assembler {
    /// Time of a turn where the radar does not give it, ns.
    turn_ns: i64,
    locator: BeamLocator,
    clock: DeviceClock,
    current: Option<OpenSweep>,
    /// A beam of the next sweep may overtake the current one's last.
    next: Option<OpenSweep>,
    finished: Sweep,
    /// Sweeps that are not in use.
    spare: Vec<Sweep>,
    /// The last sweep that was given, or passed over; `None` until one begins.
    done: Option<i64>,
    /// The sweep in whose midst the first beam was.
    cut: Option<i64>,
    /// Beams below this number are in a sweep or counted as lost.
    accounted: i64,
    doubts: Doubts,
    counters: Counters,
}

impl Assembler {
    /// `turn_ns` is the time of a turn where the radar does not give it.
    pub fn new(turn_ns: i64) -> Self {
        Self {
            turn_ns: turn_ns.max(1),
            locator: BeamLocator::new(turn_ns.max(1)),
            clock: DeviceClock::default(),
            current: None,
            next: None,
            finished: Sweep::default(),
            spare: vec![Sweep::default(), Sweep::default()],
            done: None,
            cut: None,
            accounted: 0,
            doubts: Doubts::default(),
            counters: Counters::default(),
        }
    }

    /// A beam of another sender came: the next sweep is contested.
    pub(crate) fn count_other_sender(&mut self) {
        self.doubts.other_senders += 1;
    }

    /// Begins with nothing, for another sender; keeps its memory.
    pub(crate) fn clear(&mut self) {
        let sweeps = [self.current.take(), self.next.take()];
        self.spare
            .extend(sweeps.into_iter().flatten().map(|open| open.sweep));
        self.finished.begin(BeamLayout::default());
        let spare = std::mem::take(&mut self.spare);
        let finished = std::mem::take(&mut self.finished);
        *self = Self {
            spare,
            finished,
            ..Self::new(self.turn_ns)
        };
    }

    /// Ends with the last beams that it has. They are not contested by the sender that follows.
    pub(crate) fn end(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        self.doubts.other_senders = 0;
        self.restart(whole);
    }

    /// Goes on counting where the one before it ended.
    pub(crate) fn succeed(&mut self, before: &Self) {
        self.counters += before.counters;
        self.counters.clock_restarts += before.clock.restarts();
        self.counters.anew += 1;
    }

    /// Takes a beam; hands out the sweep that it makes whole.
    pub fn push(&mut self, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) {
        self.counters.beams += 1;
        self.doubts.contradicted += u64::from(beam.contradicted);
        self.counters.contradicted += u64::from(beam.contradicted);
        if beam.layout.beams != self.locator.beams {
            self.restart(whole);
            self.locator.beams = beam.layout.beams;
        }
        if self.locator.turns_round(beam) {
            self.restart(whole);
        }
        let (mut id, mut number) = self.locator.locate(beam);
        if self.locator.begins_anew(number) {
            self.counters.anew += 1;
            self.restart(whole);
            (id, number) = self.locator.locate(beam);
        }
        if self.locator.was_paused(beam, number) {
            self.counters.pauses += 1;
            self.restart(whole);
            (id, number) = self.locator.locate(beam);
        }
        self.locator.take(beam, id, number);
        if self.done.is_none() && !self.begin(beam, id, number) {
            self.counters.before += 1;
            return;
        }
        self.take(beam, id, number, whole);
    }

    /// What comes next does not continue what was: gives what is collected, if it is half a sweep
    /// at least.
    pub fn restart(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        while self.current.is_some() {
            self.finish(true, whole);
        }
        self.locator.restart();
        self.done = None;
        self.cut = None;
    }

    /// Gives all counters.
    pub fn counts(&self, visit: &mut dyn FnMut(Count)) {
        let mut counters = self.counters;
        counters.clock_restarts += self.clock.restarts();
        counters.visit(visit);
    }

    /// Whether a sweep begins here, so that what comes from now on is collected.
    fn begin(&mut self, beam: &RawBeam, id: i64, number: i64) -> bool {
        let cut = *self.cut.get_or_insert(id);
        let (begins, first) = match beam.position {
            BeamPosition::Numbered { beam, .. } => {
                (beam == 0 || id > cut, id * i64::from(self.locator.beams))
            }
            BeamPosition::Running(_) => {
                let at_begin = i64::from(self.locator.past_border(beam)) < self.locator.step();
                let begins = (at_begin || id > cut) && self.locator.knows_sense();
                (begins, number)
            }
        };
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
                match self.finished.copy_of(number) {
                    Some(copy) => self.doubled(beam, copy),
                    None => {
                        self.counters.late += 1;
                        self.doubts.late += 1;
                    }
                }
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

    fn open(&mut self, beam: &RawBeam, id: i64) -> OpenSweep {
        let mut sweep = self.spare.pop().unwrap_or_default();
        sweep.begin(beam.layout);
        OpenSweep { id, sweep }
    }

    fn add(&mut self, sweep: &mut Sweep, beam: &RawBeam, number: i64) {
        let reordered = sweep.is_past(number);
        if let Some(copy) = sweep.copy_of(number) {
            self.doubled(beam, copy);
        } else if !sweep.add(beam, number) {
            self.counters.lost += 1;
        } else if reordered {
            self.counters.reordered += 1;
        }
    }

    /// A beam came once more. A network makes copies, but never different ones.
    fn doubled(&mut self, beam: &RawBeam, copy: u32) {
        self.counters.doubled += 1;
        if beam.fingerprint != copy {
            self.counters.contradicted += 1;
            self.doubts.contradicted += 1;
        }
    }

    /// Whether no beam can be missing any more. A running counter's sweep ends where the next
    /// step, even a short one, passes the border.
    fn is_whole(&self, sweep: &Sweep, beam: &RawBeam) -> bool {
        let all = sweep.beams() >= usize::from(self.locator.beams);
        let at_end = match beam.position {
            BeamPosition::Numbered { .. } => true,
            BeamPosition::Running(_) => {
                i64::from(self.locator.past_border(beam)) + self.locator.step() * 3 / 4 >= TURN
            }
        };
        all && at_end
    }

    /// Gives the current sweep; one that is cut lacks what was to come of its turn.
    fn finish(&mut self, cut: bool, whole: &mut dyn FnMut(&Sweep)) {
        let Some(OpenSweep { id, mut sweep }) = self.current.take() else {
            return;
        };
        self.current = self.next.take();
        // A running counter's sweep has every number up to the next one's first.
        let follower = self.current.as_ref();
        let follower = follower.and_then(|open| open.sweep.slots.first());
        let end = match (self.locator.is_running(), follower) {
            (false, _) => (id + 1) * i64::from(self.locator.beams),
            (true, Some(first)) => first.number,
            (true, None) => sweep.newest + 1,
        };
        let expected = end.saturating_sub(self.accounted).max(0);
        self.accounted = self.accounted.max(end);
        self.done = Some(id);
        let missing = expected.saturating_sub(sweep.beams() as i64).max(0);
        self.counters.lost += missing.unsigned_abs();
        // What a radar that has gone would have sent is missing in the sweep, but was not lost on
        // the way.
        let whole_turn = i64::from(self.locator.beams) * i64::from(cut);
        sweep.finish(expected.max(whole_turn));
        std::mem::swap(&mut self.finished, &mut sweep);
        self.spare.push(sweep);
        self.give(whole);
    }

    fn give(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        let sweep = &mut self.finished;
        let counters = &mut self.counters;
        // Nothing can be registered with less than half a turn.
        if 2 * sweep.beams() < usize::from(self.locator.beams) {
            counters.discarded += sweep.beams() as u64;
            return;
        }
        let turn_ns = sweep.layout().turn_ns.unwrap_or(self.turn_ns);
        let (beams, clock) = (self.locator.beams, &mut self.clock);
        let timing = Timing::from_beams(&sweep.slots, beams, turn_ns, clock);
        sweep.timing = timing;
        let doubts = std::mem::take(&mut self.doubts);
        sweep.contested = doubts.contest(self.locator.beams);
        counters.contested += u64::from(sweep.is_contested());
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
