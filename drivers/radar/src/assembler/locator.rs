//! Which sweep a beam belongs to, and its number in the stream.

use crate::sweep::TURN;
use crate::{BeamPosition, RawBeam};

/// Beams by which a running counter may go back: TCP keeps the order.
const BACK_MAX: i64 = 2;
/// Steps in one sense, less those in the other, after which the radar's sense of rotation is
/// known.
const TURNED: i64 = 4;

/// The last beam of a running counter.
#[derive(Clone, Copy, Debug)]
struct RunningCounter {
    number: i64,
    /// How far the radar has turned since the border of the first sweep.
    unwrapped: i64,
}

/// The last beam that came.
#[derive(Clone, Copy, Debug)]
struct LastBeam {
    number: i64,
    device_ns: Option<i64>,
    arrival_ns: i64,
}

/// Follows the numbers and azimuths of a stream of beams.
#[derive(Debug, Default)]
pub(super) struct BeamLocator {
    /// Time of a turn where the radar does not give it, ns.
    turn_ns: i64,
    /// Beams of a whole sweep.
    pub beams: u16,
    running: Option<RunningCounter>,
    last: Option<LastBeam>,
    /// In which sense a running counter's azimuths go: 1 they rise, -1 they fall.
    sense: i64,
    turned: i64,
    azimuth: Option<u32>,
}

impl BeamLocator {
    pub fn new(turn_ns: i64) -> Self {
        Self {
            turn_ns,
            sense: 1,
            ..Self::default()
        }
    }

    /// What comes next does not continue what was; the sense of rotation stays.
    pub fn restart(&mut self) {
        self.last = None;
        self.running = None;
        self.azimuth = None;
    }

    /// Whether beams have a running counter.
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// Whether the sense of rotation is known.
    pub fn knows_sense(&self) -> bool {
        self.turned == self.sense * TURNED
    }

    /// From one beam to the next, in counts of a turn.
    pub fn step(&self) -> i64 {
        TURN / i64::from(self.beams.max(1))
    }

    /// How far a beam of a running counter lies behind the border between two sweeps. That is half
    /// a step before the encoder's zero: many radars have a beam at zero, which an unsteady
    /// encoder puts on either side.
    pub fn past_border(&self, beam: &RawBeam) -> u32 {
        (self.sense * i64::from(beam.azimuth) + self.step() / 2) as u32
    }

    /// Watches in which sense azimuths go; `true` where it is another one than before.
    pub fn turns_round(&mut self, beam: &RawBeam) -> bool {
        if let Some(last) = self.azimuth.replace(beam.azimuth) {
            let step = beam.azimuth.wrapping_sub(last).cast_signed();
            self.turned = (self.turned + i64::from(step.signum())).clamp(-TURNED, TURNED);
        }
        let other = self.turned == -self.sense * TURNED;
        if other {
            self.sense = -self.sense;
        }
        other && matches!(beam.position, BeamPosition::Running(_))
    }

    /// A beam's sweep, and its number in the stream.
    pub fn locate(&self, beam: &RawBeam) -> (i64, i64) {
        match beam.position {
            BeamPosition::Numbered { sweep, beam } => {
                // Numbers go on at 0 after 2^32.
                let id = self.last.map_or(i64::from(sweep), |last| {
                    let last = last.number.div_euclid(i64::from(self.beams.max(1)));
                    last + i64::from(sweep.wrapping_sub(last as u32).cast_signed())
                });
                (id, id * i64::from(self.beams) + i64::from(beam))
            }
            BeamPosition::Running(counter) => {
                let Some(last) = self.running else {
                    return (0, i64::from(counter));
                };
                let passed = i64::from(counter.wrapping_sub(last.number as u16).cast_signed());
                // How far the radar has turned meanwhile; its low bits are those of the azimuth
                // that is expected.
                let expected = last.unwrapped + passed * self.step();
                let off = self
                    .past_border(beam)
                    .wrapping_sub(expected as u32)
                    .cast_signed();
                let unwrapped = expected + i64::from(off);
                (unwrapped.div_euclid(TURN), last.number + passed)
            }
        }
    }

    /// Whether a running counter leaps as only that of a sender that was started anew does.
    /// Numbered beams that do not follow are another stream's.
    pub fn begins_anew(&self, number: i64) -> bool {
        self.running
            .is_some_and(|last| number < last.number - BACK_MAX)
    }

    /// Whether the radar has stood still for a turn or more although it counts on: what it saw
    /// before is another sweep.
    pub fn was_paused(&self, beam: &RawBeam, number: i64) -> bool {
        let Some(last) = self.last else {
            return false;
        };
        let turn_ns = beam.layout.turn_ns.unwrap_or(self.turn_ns);
        let steps = number.saturating_sub(last.number).max(0);
        let step_ns = turn_ns / i64::from(self.beams.max(1));
        let longest_ns = turn_ns.saturating_add(steps.saturating_mul(step_ns));
        let paused = |now_ns: i64, then_ns: i64| now_ns.saturating_sub(then_ns) > longest_ns;
        // A host that was busy sees it in the arrivals alone, a clock that was set in the stamps
        // alone.
        let by_device = beam.device_ns.zip(last.device_ns);
        by_device.is_none_or(|(now, then)| paused(now, then))
            && paused(beam.arrival_ns, last.arrival_ns)
    }

    /// A beam was located: the next one follows it.
    pub fn take(&mut self, beam: &RawBeam, id: i64, number: i64) {
        self.last = Some(LastBeam {
            number,
            device_ns: beam.device_ns,
            arrival_ns: beam.arrival_ns,
        });
        if let BeamPosition::Running(_) = beam.position {
            let unwrapped = id * TURN + i64::from(self.past_border(beam));
            self.running = Some(RunningCounter { number, unwrapped });
        }
    }
}
