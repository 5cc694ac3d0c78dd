//! Who is at the other end, and whether that is he: each end shows the number that the other one
//! asked it for, so that a stream which somebody has recorded is refused.

use crate::frame::Frame;
use std::collections::VecDeque;
use std::hash::{BuildHasher, Hasher, RandomState};

/// Frames up to the highest that are distinguished.
const BITS: u64 = 64;
/// Processes that were replaced, of which the numbers are kept: more than robots of one name.
const FORMER: usize = 16;

/// What was asked of a process at the other end.
#[derive(Clone, Copy, Debug)]
struct Asked {
    session: u64,
    challenge: u64,
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// It is the other end's, and new.
    Taken,
    /// The same, and the first of another process.
    TakenAnew,
    /// Its sender has to show something first: answer it.
    Asked,
    /// It was sent before, or for another process: refused.
    Refused,
    /// Its sender was replaced by another process: refused. A process that was started again does
    /// not come back, so two have one name.
    Former,
}

/// The session of one end.
#[derive(Debug)]
pub struct Session {
    own: u64,
    /// What to show.
    proof: u64,
    /// Who has shown what it was asked for.
    peer: Option<Asked>,
    /// Who has yet to.
    pending: Option<Asked>,
    /// Sessions that were the peer's before.
    former: VecDeque<u64>,
    /// Highest number of the peer's frames, and which up to it have come.
    pub highest: u64,
    pub arrived: u64,
}

impl Session {
    /// Of a process that begins.
    pub fn new() -> Self {
        Self {
            own: random(),
            proof: 0,
            peer: None,
            pending: None,
            former: VecDeque::new(),
            highest: 0,
            arrived: 0,
        }
    }

    /// Whether the other end would take what is sent.
    pub fn is_open(&self) -> bool {
        self.proof != 0
    }

    /// Whether the other end has shown what it was asked for.
    pub fn is_known(&self) -> bool {
        self.peer.is_some()
    }

    /// Writes what shows the other end who this is.
    pub fn sign(&self, frame: &mut Frame) {
        frame.session = self.own;
        frame.proof = self.proof;
        // Who has shown it is not asked again.
        frame.challenge = self.pending.map_or(0, |asked| asked.challenge);
        frame.challenged = self.pending.map_or(0, |asked| asked.session);
        frame.highest = self.highest;
        frame.arrived = self.arrived;
    }

    /// Judges a frame.
    pub fn admit(&mut self, frame: &Frame) -> Admission {
        if frame.session == self.own {
            return Admission::Refused;
        }
        if self.former.contains(&frame.session) {
            return Admission::Former;
        }
        let is = |asked: &Asked| {
            asked.session == frame.session && asked.challenge == frame.proof && frame.proof != 0
        };
        if self.peer.as_ref().is_some_and(is) {
            if !self.number(frame.number) {
                return Admission::Refused;
            }
            self.learn(frame);
            return Admission::Taken;
        }
        if self.pending.as_ref().is_some_and(is) {
            let replaced = std::mem::replace(&mut self.peer, self.pending.take());
            self.former.extend(replaced.map(|peer| peer.session));
            if self.former.len() > FORMER {
                self.former.pop_front();
            }
            (self.highest, self.arrived) = (0, 0);
            self.number(frame.number);
            self.learn(frame);
            return Admission::TakenAnew;
        }
        // One that answers this very process is answered, and so is one that asks without having
        // been asked.
        let answers = frame.challenged == self.own;
        if frame.proof != 0 && !answers {
            return Admission::Refused;
        }
        let is_pending = self
            .pending
            .is_some_and(|asked| asked.session == frame.session);
        if !is_pending {
            self.pending = Some(Asked {
                session: frame.session,
                challenge: random(),
            });
        }
        self.learn(frame);
        Admission::Asked
    }

    /// What is to be shown, where it was asked of this process.
    fn learn(&mut self, frame: &Frame) {
        if frame.challenged == self.own {
            self.proof = frame.challenge;
        }
    }

    /// Whether a number is new.
    fn number(&mut self, number: u64) -> bool {
        if number <= self.highest {
            return false;
        }
        let step = number - self.highest;
        self.arrived = self.arrived.checked_shl(step as u32).unwrap_or(0);
        if step >= BITS {
            self.arrived = 0;
        }
        self.arrived |= 1;
        self.highest = number;
        true
    }
}

/// Whether a frame is among those that have come; `None` where it is not known yet.
pub fn has_arrived(number: u64, highest: u64, arrived: u64) -> Option<bool> {
    let back = highest.checked_sub(number)?;
    Some(back < BITS && arrived >> back & 1 == 1)
}

/// A number that nobody can guess, and not 0.
fn random() -> u64 {
    RandomState::new().build_hasher().finish().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame that one end sends now.
    fn frame(from: &Session, number: u64) -> Frame {
        let mut frame = Frame {
            number,
            ..Frame::default()
        };
        from.sign(&mut frame);
        frame
    }

    /// Lets two ends come to know each other; gives all that `a` has sent.
    fn open(a: &mut Session, b: &mut Session) -> Vec<Frame> {
        let mut sent = Vec::new();
        for number in 1..8 {
            sent.push(frame(a, number));
            b.admit(&frame(a, number));
            a.admit(&frame(b, number));
        }
        assert!(a.is_open() && a.is_known() && b.is_open() && b.is_known());
        sent
    }

    #[test]
    fn a_recorded_stream_is_refused_by_this_process_and_by_another_one() {
        let (mut robot, mut base) = (Session::new(), Session::new());
        let mut recorded = open(&mut robot, &mut base);
        for number in 8..20 {
            let frame = frame(&robot, number);
            assert_eq!(base.admit(&frame), Admission::Taken);
            recorded.push(frame);
        }
        let taken = |admission| matches!(admission, Admission::Taken | Admission::TakenAnew);
        assert!(!recorded.iter().any(|frame| taken(base.admit(frame))));
        // What goes on is taken all the same.
        assert_eq!(base.admit(&frame(&robot, 20)), Admission::Taken);
        let mut next = Session::new();
        assert!(!recorded.iter().any(|frame| taken(next.admit(frame))));
        open(&mut robot, &mut next);
        assert!(!recorded.iter().any(|frame| taken(next.admit(frame))));
    }

    #[test]
    fn of_two_robots_with_one_name_the_last_one_stays_and_the_other_one_is_refused() {
        let (mut first, mut base) = (Session::new(), Session::new());
        open(&mut first, &mut base);
        let mut second = Session::new();
        open(&mut second, &mut base);
        for number in 8..40 {
            // Each hears what the base sends to either.
            let sent = frame(&base, number);
            assert_eq!(first.admit(&sent), Admission::Refused);
            assert_eq!(second.admit(&sent), Admission::Taken);
            assert_eq!(base.admit(&frame(&first, number)), Admission::Former);
            assert_eq!(base.admit(&frame(&second, number)), Admission::Taken);
        }
    }

    #[test]
    fn either_end_may_be_another_process_at_any_time() {
        let (mut robot, mut base) = (Session::new(), Session::new());
        for turn in 0..6 {
            open(&mut robot, &mut base);
            match turn % 2 {
                0 => robot = Session::new(),
                _ => base = Session::new(),
            }
        }
        assert_eq!(has_arrived(5, 9, 0b1_0001), Some(true));
        assert_eq!(has_arrived(6, 9, 0b1_0001), Some(false));
        assert_eq!(has_arrived(10, 9, 0b1), None);
        assert_eq!(has_arrived(1, 99, u64::MAX), Some(false), "too long ago");
    }
}
