//! A sweep: beams while they are collected, and their message once it is whole.

use crate::returns::Returns;
use crate::timing::Timing;
use crate::{BeamLayout, RawBeam};
use randt_geometry::elementary::{PI, wrap};
use randt_messages::{Beam, MAX_BEAMS, Message, RadarScan, Return, ScanHead, SensorKind};

/// Counts of a turn, as azimuths have them.
pub(crate) const TURN: i64 = 1 << 32;

/// A beam in its sweep.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BeamSlot {
    /// Its number in the stream.
    pub number: i64,
    /// As the radar counts it.
    pub azimuth: u32,
    /// The same, over the encoder's zero, rising or falling all along.
    pub unwrapped: i64,
    pub device_ns: Option<i64>,
    pub arrival_ns: i64,
    /// Checksum of all its bytes.
    fingerprint: u32,
    /// Its index in the order of arrival, by which its returns are found.
    arrival_index: u16,
}

/// One turn of the radar, its beams in the order in which they were measured.
#[derive(Debug, Default)]
pub struct Sweep {
    pub(crate) slots: Vec<BeamSlot>,
    returns: Returns,
    /// First return of each beam, in the order of arrival, and the end.
    firsts: Vec<u32>,
    /// The highest number of a beam.
    pub(crate) newest: i64,
    below_floor: u32,
    layout: BeamLayout,
    pub(crate) timing: Timing,
    lost: u32,
    pub(crate) contested: bool,
}

impl Sweep {
    pub(crate) fn begin(&mut self, layout: BeamLayout) {
        self.slots.clear();
        self.returns.clear();
        self.firsts.clear();
        self.newest = i64::MIN;
        self.below_floor = 0;
        self.layout = layout;
        self.lost = 0;
        self.contested = false;
    }

    /// Whether a later beam is here already.
    pub(crate) fn is_past(&self, number: i64) -> bool {
        number < self.newest
    }

    /// The fingerprint of a beam that is here already.
    pub(crate) fn copy_of(&self, number: i64) -> Option<u32> {
        if number > self.newest {
            return None;
        }
        let copy = self.slots.iter().rev().find(|slot| slot.number == number);
        copy.map(|slot| slot.fingerprint)
    }

    /// Takes a beam; `false` where there is no room.
    pub(crate) fn add(&mut self, beam: &RawBeam, number: i64) -> bool {
        if self.slots.len() >= MAX_BEAMS {
            return false;
        }
        let arrival_index = self.slots.len() as u16;
        self.slots.push(BeamSlot {
            number,
            azimuth: beam.azimuth,
            unwrapped: 0,
            device_ns: beam.device_ns,
            arrival_ns: beam.arrival_ns,
            fingerprint: beam.fingerprint,
            arrival_index,
        });
        self.newest = self.newest.max(number);
        self.below_floor = self.below_floor.saturating_add(beam.dropped);
        for echo in &beam.echoes {
            self.returns.push(Return {
                range_m: beam.layout.range_m(echo.bin) as f32,
                intensity: echo.intensity,
                beam: arrival_index,
                bin: echo.bin,
            });
        }
        true
    }

    /// The last beam is in: puts all in order. `expected` is how many beams should be here.
    pub(crate) fn finish(&mut self, expected: i64) {
        let missing = expected.saturating_sub(self.slots.len() as i64).max(0);
        self.lost = missing.min(i64::from(self.layout.beams)) as u32;
        self.slots.sort_unstable_by_key(|slot| slot.number);
        unwrap(&mut self.slots, self.layout.beams);
        self.returns.limit();
        let items = &self.returns.items;
        let mut at = 0;
        for index in 0..=self.slots.len() {
            let rest = items.get(at..).unwrap_or_default();
            at += rest.partition_point(|item| usize::from(item.beam) < index);
            self.firsts.push(at as u32);
        }
    }

    /// How the beams lie.
    pub fn layout(&self) -> BeamLayout {
        self.layout
    }

    /// How many beams there are.
    pub fn beams(&self) -> usize {
        self.slots.len()
    }

    /// How many should be and are not.
    pub fn beams_lost(&self) -> u32 {
        self.lost
    }

    /// How many returns it has: the items of its message.
    pub fn len(&self) -> usize {
        self.returns.items.len()
    }

    /// Whether nothing was above the floor.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether beams of another sender came meanwhile, so that not all of it may be the radar's.
    pub fn is_contested(&self) -> bool {
        self.contested
    }

    /// Returns at or below the floor, left out.
    pub fn below_floor(&self) -> u32 {
        self.below_floor
    }

    /// Returns over what a message holds, left out: the weakest.
    pub fn over_limit(&self) -> u32 {
        self.returns.over
    }

    /// First and last instant, ns: half a step before the first beam and after the last.
    pub fn span_ns(&self) -> (i64, i64) {
        (self.timing.begin_ns, self.timing.end_ns)
    }

    /// The beams' counter, azimuth as the radar counts it, and time, ns.
    pub fn beam_times(&self) -> impl Iterator<Item = (u16, u32, i64)> {
        self.slots.iter().map(|slot| {
            let stamp_ns = self.timing.ns(slot.unwrapped);
            (slot.number as u16, slot.azimuth, stamp_ns)
        })
    }

    /// Lays out the head of its message; it is all zero before.
    pub fn write_head(&self, sensor: SensorKind, head: &mut ScanHead) {
        head.header.stamp_ns = self.timing.end_ns;
        let sweep = &mut head.sweep;
        sweep.begin_ns = self.timing.begin_ns;
        sweep.end_ns = self.timing.end_ns;
        sweep.sensor = sensor as u32;
        sweep.contested = u64::from(self.contested);
        sweep.beam_count = self.slots.len() as u32;
        sweep.beams_lost = self.lost;
        sweep.returns_dropped = self.below_floor.saturating_add(self.over_limit());
        sweep.range_resolution_m = self.layout.bin_m as f32;
        sweep.azimuth_step_rad = (2.0 * PI / f64::from(self.layout.beams.max(1))) as f32;
        let mut first_return = 0;
        for (slot, entry) in self.slots.iter().zip(&mut sweep.beams) {
            *entry = Beam {
                stamp_ns: self.timing.ns(slot.unwrapped),
                azimuth_rad: self.azimuth_rad(slot.azimuth),
                first_return,
            };
            first_return += self.returns_of(slot).len() as u32;
        }
    }

    /// Lays out the items of its message, [`Sweep::len`] of them.
    pub fn write_items(&self, items: &mut [Return]) {
        let mut rest = items.iter_mut();
        for (slot, beam) in self.slots.iter().zip(0..) {
            for (from, to) in self.returns_of(slot).iter().zip(&mut rest) {
                *to = Return { beam, ..*from };
            }
        }
    }

    /// The same as a message of its own.
    pub fn message(&self, sensor: SensorKind) -> Message<RadarScan> {
        let mut message = Message::<RadarScan>::default();
        message.items.resize(self.len(), Return::default());
        self.write_head(sensor, &mut message.head);
        self.write_items(&mut message.items);
        message
    }

    fn returns_of(&self, slot: &BeamSlot) -> &[Return] {
        let index = usize::from(slot.arrival_index);
        let ends = self.firsts.get(index).zip(self.firsts.get(index + 1));
        ends.and_then(|(first, end)| self.returns.items.get(*first as usize..*end as usize))
            .unwrap_or_default()
    }

    /// Counter-clockwise, in [-pi, pi).
    fn azimuth_rad(&self, azimuth: u32) -> f32 {
        let angle_rad = f64::from(azimuth) * (2.0 * PI / TURN as f64);
        let sense = if self.layout.clockwise { -1.0 } else { 1.0 };
        let wrapped = wrap(sense * angle_rad) as f32;
        // Rounding can reach pi, which is -pi.
        if wrapped >= core::f32::consts::PI {
            -core::f32::consts::PI
        } else {
            wrapped
        }
    }
}

/// Follows the azimuths over the encoder's zero. Beams may be missing: the numbers give how many,
/// the layout how far that is, and most beams the sense of rotation.
fn unwrap(slots: &mut [BeamSlot], beams: u16) {
    let difference = |to: u32, from: u32| i64::from(to.wrapping_sub(from).cast_signed());
    let pairs = slots.iter().zip(slots.iter().skip(1));
    let turned: i64 = pairs
        .map(|(a, b)| difference(b.azimuth, a.azimuth).signum())
        .sum();
    let step = TURN / i64::from(beams.max(1)) * if turned < 0 { -1 } else { 1 };
    let mut last: Option<(i64, i64)> = None;
    for slot in slots {
        slot.unwrapped = match last {
            None => i64::from(slot.azimuth),
            Some((number, unwrapped)) => {
                let expected = unwrapped + step * (slot.number - number).clamp(1, 1 << 12);
                // Its low bits are those of the azimuth that is expected.
                expected + difference(slot.azimuth, expected as u32)
            }
        };
        last = Some((slot.number, slot.unwrapped));
    }
}
