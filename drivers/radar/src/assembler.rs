//! Beams to sweeps.
//!
//! Responsible for which beam belongs to which sweep, for what is lost, doubled and late, and for when a sweep is whole.
//! Pure. Not responsible for a beam's bytes, nor for where sweeps go.

mod counters;

use crate::sweep::{Sweep, TURN};
use crate::timing::{TimedBy, Timing};
use crate::{BeamLayout, Place, RawBeam};
use counters::{Counters, Doubts};
use randt_device::{Count, DeviceClock};

/// Beams by which a running counter may go back: TCP keeps the order.
const BACK_MAX: i64 = 2;
/// Steps in one sense, less those in the other, after which a radar is believed to turn that way.
const TURNED: i64 = 4;

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
    doubts: Doubts,
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
            doubts: Doubts::default(),
            counters: Counters::default(),
        }
    }

    /// A beam of another sender came, which the next sweep is to say.
    pub(crate) fn heard_stranger(&mut self) {
        self.doubts.strangers += 1;
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

    /// Ends with the last beams that it has. They are not contested by whom they make way for.
    pub(crate) fn end(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        self.doubts.strangers = 0;
        self.restart(whole);
    }

    /// Goes on counting where the one before it ended.
    pub(crate) fn succeed(&mut self, before: &Self) {
        self.counters.add(&before.counters);
        self.counters.clock_restarts += before.clock.restarts();
        self.counters.anew += 1;
    }

    /// Takes a beam; hands out the sweep that it makes whole.
    pub fn push(&mut self, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) {
        self.counters.beams += 1;
        self.doubts.contradicted += u64::from(beam.contradicted);
        self.counters.contradicted += u64::from(beam.contradicted);
        if beam.layout.beams != self.beams {
            self.restart(whole);
            self.beams = beam.layout.beams;
        }
        if self.turns_round(beam) {
            self.restart(whole);
        }
        let (mut id, mut number) = self.locate(beam);
        if self.begins_anew(number) {
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
        self.counters.tell(self.clock.restarts(), tell);
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
                // Numbers go on at 0 after 2^32.
                let id = self.last.map_or(i64::from(sweep), |last| {
                    let last = last.number.div_euclid(i64::from(self.beams.max(1)));
                    last + i64::from(sweep.wrapping_sub(last as u32).cast_signed())
                });
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

    /// Whether a running counter leaps as only that of a sender that was started anew does. Numbered beams that do not
    /// follow are another stream's.
    fn begins_anew(&self, number: i64) -> bool {
        self.running
            .is_some_and(|last| number < last.number - BACK_MAX)
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

    fn open(&mut self, beam: &RawBeam, id: i64) -> Open {
        let mut sweep = self.spare.pop().unwrap_or_default();
        sweep.begin(beam.layout);
        Open { id, sweep }
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

    /// A beam came once more. A network makes copies, but no other ones.
    fn doubled(&mut self, beam: &RawBeam, copy: u32) {
        self.counters.doubled += 1;
        if beam.fingerprint != copy {
            self.counters.contradicted += 1;
            self.doubts.contradicted += 1;
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
        let doubts = std::mem::take(&mut self.doubts);
        sweep.contest(doubts.are_grave(self.beams));
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
