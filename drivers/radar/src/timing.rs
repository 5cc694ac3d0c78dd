//! When the beams of a sweep were measured.
//!
//! The radar's stamps come in bursts, its turning does not: each sweep's stamps are fitted by a
//! line over the encoder's angle. The line is in the radar's time; it is brought into the host's
//! by the beam that reached the host soonest.

use crate::sweep::{BeamSlot, TURN};
use randt_device::DeviceClock;
use randt_geometry::Rotation;

/// A turn that seems to take more or less than this many times what it should is no turn: the
/// clock was set in it.
const ODD: f64 = 2.0;

/// What a sweep's times were taken from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimedBy {
    /// The radar's own stamps.
    #[default]
    Device,
    /// The times of arrival: the radar has no stamps, or none that make sense.
    Arrival,
    /// The last arrival and the time of a turn: all came at once.
    Period,
}

/// Time over the encoder's angle: a line.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Timing {
    at: i64,
    at_ns: i64,
    ns_per_count: f64,
    pub begin_ns: i64,
    pub end_ns: i64,
    pub by: TimedBy,
}

impl Timing {
    /// Fits beams in order; `turn_ns` is what a turn should take.
    pub fn from_beams(
        slots: &[BeamSlot],
        beams: u16,
        turn_ns: i64,
        clock: &mut DeviceClock,
    ) -> Self {
        let line = by_device(slots, turn_ns, clock)
            .or_else(|| by_arrival(slots, turn_ns))
            .unwrap_or_else(|| by_period(slots, turn_ns));
        let (first, last) = ends(slots);
        // A beam's time is the middle of its share of the turn.
        let half = 0.5 * (TURN / i64::from(beams.max(1))) as f64 * sense(slots);
        Self {
            begin_ns: line.at(first as f64 - half),
            end_ns: line.at(last as f64 + half),
            ..line
        }
    }

    /// When the encoder stood there, ns.
    pub fn ns(&self, unwrapped: i64) -> i64 {
        self.at(unwrapped as f64)
    }

    fn at(&self, unwrapped: f64) -> i64 {
        let ns = self.ns_per_count * (unwrapped - self.at as f64);
        self.at_ns.saturating_add(ns.round() as i64)
    }
}

fn ends(slots: &[BeamSlot]) -> (i64, i64) {
    let unwrapped = |slot: Option<&BeamSlot>| slot.map_or(0, |slot| slot.unwrapped);
    (unwrapped(slots.first()), unwrapped(slots.last()))
}

fn sense(slots: &[BeamSlot]) -> f64 {
    let (first, last) = ends(slots);
    if last < first { -1.0 } else { 1.0 }
}

/// A fit that is a turn of about the time that it should take.
fn fit(
    rows: impl Iterator<Item = (i64, i64)> + Clone,
    turn_ns: i64,
    sense: f64,
) -> Option<Rotation> {
    let (_, first_ns) = rows.clone().next()?;
    let rotation = Rotation::fit(rows, first_ns, 1);
    let ratio = rotation.duration_ns(sense * TURN as f64) / turn_ns as f64;
    (1.0 / ODD..=ODD).contains(&ratio).then_some(rotation)
}

fn by_device(slots: &[BeamSlot], turn_ns: i64, clock: &mut DeviceClock) -> Option<Timing> {
    if slots.iter().any(|slot| slot.device_ns.is_none()) {
        return None;
    }
    let device_ns = |slot: &BeamSlot| slot.device_ns.unwrap_or_default();
    let rows = slots.iter().map(|slot| (slot.unwrapped, device_ns(slot)));
    let rotation = fit(rows, turn_ns, sense(slots))?;
    let device_ns = |slot: &BeamSlot| rotation.ns(slot.unwrapped as f64);
    let delay_ns = |slot: &&BeamSlot| slot.arrival_ns.saturating_sub(device_ns(slot));
    let quickest = slots.iter().min_by_key(delay_ns)?;
    let at_ns = clock.host_ns(device_ns(quickest), quickest.arrival_ns);
    Some(Timing {
        at: quickest.unwrapped,
        at_ns,
        ns_per_count: rotation.duration_ns(1.0) * (1.0 - clock.skew()),
        by: TimedBy::Device,
        ..Timing::default()
    })
}

fn by_arrival(slots: &[BeamSlot], turn_ns: i64) -> Option<Timing> {
    let rows = slots.iter().map(|slot| (slot.unwrapped, slot.arrival_ns));
    let rotation = fit(rows, turn_ns, sense(slots))?;
    let (first, _) = ends(slots);
    Some(Timing {
        at: first,
        at_ns: rotation.ns(first as f64),
        ns_per_count: rotation.duration_ns(1.0),
        by: TimedBy::Arrival,
        ..Timing::default()
    })
}

fn by_period(slots: &[BeamSlot], turn_ns: i64) -> Timing {
    Timing {
        at: ends(slots).1,
        at_ns: slots.iter().map(|slot| slot.arrival_ns).max().unwrap_or(0),
        ns_per_count: sense(slots) * turn_ns as f64 / TURN as f64,
        by: TimedBy::Period,
        ..Timing::default()
    }
}
