//! Faults of a radar's messages, each at its time.

use super::Wire;
use crate::wrong_content::WrongContent;
use crate::{FaultKind, Faults};

/// One of this many messages is corrupted.
const CORRUPTED_EVERY: u64 = 10;
/// One of this many messages is lost, doubled or late.
const ASTRAY: u64 = 20;
/// How far an unsteady encoder is off, in steps.
const JITTER_STEPS: f64 = 0.2;
/// How much too late stamps are at most, ns: a Navtech's come in bursts like that.
const JITTER_NS: i64 = 8_000_000;

/// How a message is corrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Corruption {
    /// Its checksum is wrong.
    Checksum,
    /// It is of a version that is not there yet.
    Version,
    /// It claims to be longer than any can be.
    Oversize,
}

/// The faults of one beam.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BeamFaults {
    at_s: f64,
    pub azimuth_rad: f64,
    pub late_ns: i64,
    pub fast: bool,
    pub resets: usize,
    pub contour: bool,
}

/// Applies the faults of a run to its messages.
pub(crate) struct FaultInjector {
    faults: Faults,
    random: u64,
    wrong: WrongContent,
    count: u64,
    closes: usize,
    held: Vec<Vec<u8>>,
}

impl FaultInjector {
    pub fn new(faults: Faults) -> Self {
        Self {
            random: faults.seed() | 1,
            wrong: WrongContent::new(faults.seed()),
            faults,
            count: 0,
            closes: 0,
            held: Vec::new(),
        }
    }

    /// What is wrong with a beam at a time.
    pub fn at(&mut self, at_s: f64, step_rad: f64) -> BeamFaults {
        let jitter = self.faults.is_on(FaultKind::Jitter, at_s);
        let mut now = BeamFaults {
            at_s,
            fast: self.faults.is_on(FaultKind::Skew, at_s),
            resets: self.faults.begun(FaultKind::ClockReset, at_s),
            contour: self.faults.is_on(FaultKind::Contour, at_s),
            ..BeamFaults::default()
        };
        if jitter {
            now.azimuth_rad = (self.random() - 0.5) * 2.0 * JITTER_STEPS * step_rad;
            now.late_ns = (self.random() * JITTER_NS as f64) as i64;
        }
        now
    }

    /// Sends a beam's messages with their faults; gives how many were not taken.
    pub fn send(&mut self, wire: &mut dyn Wire, messages: &mut [Vec<u8>], now: &BeamFaults) -> u64 {
        let on = |kind| self.faults.is_on(kind, now.at_s);
        self.count += 1;
        let every = |count: u64| self.count.is_multiple_of(count);
        wire.unplug(on(FaultKind::Unplug));
        wire.split(on(FaultKind::Split));
        let closes = self.faults.begun(FaultKind::Close, now.at_s);
        if closes > self.closes {
            self.closes = closes;
            messages.iter().for_each(|message| wire.close(message));
        }
        if on(FaultKind::Wrong) && every(CORRUPTED_EVERY) {
            for message in messages.iter() {
                let message = wire.wrong(message, &mut self.wrong);
                wire.send(&message);
            }
        }
        let gone = on(FaultKind::Silence) || on(FaultKind::Unplug);
        let lost = on(FaultKind::Lost) && every(ASTRAY) || on(FaultKind::Rate) && every(2);
        if gone || lost {
            return 0;
        }
        if on(FaultKind::Reordered) && every(ASTRAY) {
            self.held.extend(messages.iter().cloned());
            return 0;
        }
        if on(FaultKind::Junk) && every(CORRUPTED_EVERY) {
            wire.send(&self.junk());
        }
        for (kind, corrupt, rarely) in [
            (FaultKind::Checksum, Corruption::Checksum, true),
            (FaultKind::Version, Corruption::Version, false),
            (FaultKind::Oversize, Corruption::Oversize, true),
        ] {
            if on(kind) && (!rarely || every(CORRUPTED_EVERY)) {
                messages.iter_mut().for_each(|m| wire.corrupt(corrupt, m));
            }
        }
        if on(FaultKind::Cut) && every(CORRUPTED_EVERY) {
            messages.iter_mut().for_each(|m| m.truncate(m.len() / 2));
        }
        let is_doubled = on(FaultKind::Doubled) && every(ASTRAY);
        let times = 1 + usize::from(is_doubled);
        let now = (0..times).flat_map(|_| messages.iter());
        let untaken = now.chain(&self.held).filter(|message| !wire.send(message));
        let untaken = untaken.count() as u64;
        self.held.clear();
        untaken
    }

    /// Bytes that belong to no message, the beginning of one among them.
    fn junk(&self) -> Vec<u8> {
        let noise =
            (0..61).map(|i| (self.count.wrapping_mul(31).wrapping_add(i * 7919) >> 3) as u8);
        [0x00, 0x01, 0x03, 0x03, 0x07]
            .into_iter()
            .chain(noise)
            .collect()
    }

    /// In [0, 1): xorshift.
    fn random(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }
}
