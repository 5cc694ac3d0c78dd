//! Beams to sweeps, where every host of the network can send: whose sweeps are taken.
//!
//! Responsible for distinguishing senders, for which one is the radar, and for what others send
//! meanwhile. Pure. Each sender has an assembler of its own, so that nothing that one sends can
//! reach another one's sweep.

use crate::sweep::{Sweep, TURN};
use crate::{Assembler, BeamLayout, BeamPosition, RawBeam, Sender};
use randt_device::Count;

/// Senders that are followed beside the radar. Each costs the memory of three sweeps.
const OTHERS_MAX: usize = 4;
/// Sweeps by which a number may be late: what a network puts out of order is one.
const LATE_MAX: i64 = 2;
/// A radar turns at most this many times faster than it should: in a pause its numbers rise no
/// further.
const FAST: i64 = 2;
/// A radar without a beam for this many turns is gone, where another sender has a whole sweep to
/// show.
const GONE_TURNS: i64 = 2;
/// Of a sweep's steps from beam to beam this share may go the wrong way: encoders waver where they
/// stand still.
const BACKWARD_SHARE: usize = 8;
/// A sweep with half of its beams turns by at least this share of a turn.
const TURNED_SHARE: i64 = 8;

/// The beams of one sender that continue each other.
#[derive(Debug)]
struct Stream {
    sender: Sender,
    layout: BeamLayout,
    /// The highest number of a sweep.
    newest: u32,
    assembler: Assembler,
    beams: u64,
    /// When the last beam came, ns.
    beam_ns: i64,
    /// When the last sweep became whole, or the first beam came, ns.
    sweep_ns: i64,
}

/// Takes the beams of all senders, gives the sweeps of one: the first whose beams make a sweep
/// that turns, as long as its sweeps come. One that is gone is forgotten for the next that has
/// such a sweep. Sweeps are contested while others send.
#[derive(Debug)]
pub struct Streams {
    turn_ns: i64,
    patience_ns: i64,
    taken: Option<Stream>,
    others: Vec<Stream>,
    other_sender: Option<Sender>,
    other_beams: u64,
}

impl Streams {
    /// `turn_ns` is the time of a turn where the radar does not give it; a radar that gives no
    /// sweep for `patience_ns` makes way for another one.
    pub fn new(turn_ns: i64, patience_ns: i64) -> Self {
        Self {
            turn_ns: turn_ns.max(1),
            patience_ns: patience_ns.max(1),
            taken: None,
            others: Vec::new(),
            other_sender: None,
            other_beams: 0,
        }
    }

    /// Takes a beam; hands out the sweep that it makes whole, if that is the radar's.
    pub fn push(&mut self, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) {
        let turn_ns = self.turn_ns;
        if self.taken.is_none() && matches!(beam.position, BeamPosition::Running(_)) {
            // A connection leads to the radar itself: no other sender can come by it.
            self.taken = Some(Stream::begin(beam, Assembler::new(turn_ns)));
        }
        if let Some(taken) = &mut self.taken
            && taken.is_continued_by(beam, turn_ns)
        {
            for other in &mut self.others {
                other.assembler.count_other_sender();
            }
            taken.push(beam, whole);
            return;
        }
        if let Some(taken) = &mut self.taken {
            taken.assembler.count_other_sender();
            self.other_beams += 1;
            self.other_sender = Some(beam.sender);
        }
        let at = self.index_for(beam);
        for (i, other) in self.others.iter_mut().enumerate() {
            if i != at {
                other.assembler.count_other_sender();
            }
        }
        if self.try_stream(at, beam, whole) {
            self.taken = Some(self.others.swap_remove(at));
        }
    }

    /// Pushes a beam of a sender that is not the radar; whether it is from now on.
    fn try_stream(&mut self, at: usize, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) -> bool {
        let Some(other) = self.others.get_mut(at) else {
            return false;
        };
        let now_ns = beam.arrival_ns;
        let (turn_ns, patience_ns) = (self.turn_ns, self.patience_ns);
        let mut before = self
            .taken
            .take_if(|taken| taken.is_gone(now_ns, turn_ns, patience_ns));
        let mut is_radar = false;
        // It is handed out at once, before the stream is known to be the radar's to the others.
        let may_be = self.taken.is_none();
        let mut first = |sweep: &Sweep, give: &mut dyn FnMut(&Sweep)| {
            is_radar |= may_be && turns(sweep);
            if is_radar {
                give(sweep);
            }
        };
        match &mut before {
            None => other.push(beam, &mut |sweep| first(sweep, whole)),
            Some(before) => {
                let before = &mut before.assembler;
                other.push(beam, &mut |sweep| {
                    first(sweep, &mut |sweep| {
                        before.end(whole);
                        whole(sweep);
                    });
                });
            }
        }
        if !is_radar {
            self.taken = self.taken.take().or(before);
        } else if let Some(before) = &before {
            other.assembler.succeed(&before.assembler);
        }
        is_radar
    }

    /// The index of the stream that a beam continues, or of a new one. A new one replaces the one
    /// with the fewest beams, or one that is over.
    fn index_for(&mut self, beam: &RawBeam) -> usize {
        let turn_ns = self.turn_ns;
        let continued = |other: &Stream| other.is_continued_by(beam, turn_ns);
        if let Some(at) = self.others.iter().position(continued) {
            return at;
        }
        if self.others.len() < OTHERS_MAX {
            self.others
                .push(Stream::begin(beam, Assembler::new(turn_ns)));
            return self.others.len() - 1;
        }
        let over_ns = beam.arrival_ns.saturating_sub(self.patience_ns);
        let worth = |other: &Stream| (other.beam_ns >= over_ns, other.beams);
        let indices = 0..self.others.len();
        let at = indices.min_by_key(|at| self.others.get(*at).map(worth));
        let at = at.unwrap_or_default();
        if let Some(other) = self.others.get_mut(at) {
            let mut assembler = std::mem::replace(&mut other.assembler, Assembler::new(turn_ns));
            assembler.clear();
            *other = Stream::begin(beam, assembler);
        }
        at
    }

    /// What comes next does not continue what was: gives what is collected, if it is half a sweep
    /// at least.
    pub fn restart(&mut self, whole: &mut dyn FnMut(&Sweep)) {
        if let Some(taken) = &mut self.taken {
            taken.assembler.restart(whole);
        }
        self.others.clear();
    }

    /// The sender whose sweeps are taken.
    pub fn taken(&self) -> Option<Sender> {
        self.taken.as_ref().map(|taken| taken.sender)
    }

    /// The last sender beside it.
    pub fn other_sender(&self) -> Option<Sender> {
        self.other_sender
    }

    /// The sender of the last beam that has shown no sweep yet.
    pub fn candidate(&self) -> Option<Sender> {
        let last = self.others.iter().max_by_key(|other| other.beam_ns)?;
        Some(last.sender)
    }

    /// Gives all counters.
    pub fn counts(&self, visit: &mut dyn FnMut(Count)) {
        visit(Count::event("beams_of_other_senders", self.other_beams));
        match &self.taken {
            Some(taken) => taken.assembler.counts(visit),
            None => Assembler::new(self.turn_ns).counts(visit),
        }
    }
}

impl Stream {
    fn begin(beam: &RawBeam, assembler: Assembler) -> Self {
        Self {
            sender: beam.sender,
            layout: beam.layout,
            newest: sweep_of(beam),
            assembler,
            beams: 0,
            beam_ns: beam.arrival_ns,
            sweep_ns: beam.arrival_ns,
        }
    }

    /// Whether a beam is this sender's, and its number is one that can come now. A connection's
    /// all are.
    fn is_continued_by(&self, beam: &RawBeam, turn_ns: i64) -> bool {
        if self.sender != beam.sender {
            return false;
        }
        let BeamPosition::Numbered { sweep, .. } = beam.position else {
            return true;
        };
        let ahead = i64::from(sweep.wrapping_sub(self.newest).cast_signed());
        let passed_ns = beam.arrival_ns.saturating_sub(self.beam_ns).max(0);
        let ahead_max = 1 + FAST * (passed_ns / turn_ns);
        self.layout == beam.layout && (-LATE_MAX..=ahead_max).contains(&ahead)
    }

    fn push(&mut self, beam: &RawBeam, whole: &mut dyn FnMut(&Sweep)) {
        let sweep = sweep_of(beam);
        if sweep.wrapping_sub(self.newest).cast_signed() > 0 {
            self.newest = sweep;
        }
        self.beams += 1;
        self.beam_ns = self.beam_ns.max(beam.arrival_ns);
        let sweep_ns = &mut self.sweep_ns;
        self.assembler.push(beam, &mut |sweep| {
            *sweep_ns = beam.arrival_ns;
            whole(sweep);
        });
    }

    /// Whether it has stopped sending, or sends what makes no sweeps.
    fn is_gone(&self, now_ns: i64, turn_ns: i64, patience_ns: i64) -> bool {
        now_ns.saturating_sub(self.beam_ns) > GONE_TURNS.saturating_mul(turn_ns)
            || now_ns.saturating_sub(self.sweep_ns) > patience_ns
    }
}

/// The number of a beam's sweep; a running counter has none.
fn sweep_of(beam: &RawBeam) -> u32 {
    match beam.position {
        BeamPosition::Numbered { sweep, .. } => sweep,
        BeamPosition::Running(_) => 0,
    }
}

/// Whether a sweep's beams turn as those of a radar do: in one sense, and by about a turn at most.
fn turns(sweep: &Sweep) -> bool {
    let slots = &sweep.slots;
    let (Some(first), Some(last)) = (slots.first(), slots.last()) else {
        return false;
    };
    let turned = last.unwrapped - first.unwrapped;
    let steps = slots.iter().zip(slots.iter().skip(1));
    let backward = steps
        .filter(|(one, next)| (next.unwrapped - one.unwrapped).signum() != turned.signum())
        .count();
    BACKWARD_SHARE * backward <= slots.len()
        && (TURN / TURNED_SHARE..=TURN + TURN / TURNED_SHARE).contains(&turned.abs())
}

#[cfg(test)]
mod tests;
