//! A filtered scan as odometry keeps it: checked, in memory of its own, saved without what the
//! message leaves empty.

use crate::stamps::STAMPS_NS;
use core::ops::{Deref, DerefMut};
use randt_messages::{Message, MessageRef, PointsHead, RadarPoints, Return, SweepHead, Topic};
use randt_persist::{Error, Persist, Reader, Writer};

/// Longest sweep, ns: the slowest radars turn once in seconds.
const SWEEP_MAX_NS: i64 = 60_000_000_000;
/// Bytes of the head before its table of beams, which is mostly empty.
const BEFORE_BEAMS: usize =
    core::mem::offset_of!(PointsHead, sweep) + core::mem::offset_of!(SweepHead, beams);

/// Whether a scan's times are possible.
pub fn is_sweep(scan: MessageRef<'_, RadarPoints>) -> bool {
    let sweep = &scan.head.sweep;
    STAMPS_NS.contains(&sweep.end_ns)
        && (0..=SWEEP_MAX_NS).contains(&(sweep.end_ns.saturating_sub(sweep.begin_ns)))
}

/// A filtered scan in memory of its own.
#[derive(Clone, Debug, Default)]
pub struct Scan(Message<RadarPoints>);

impl Deref for Scan {
    type Target = Message<RadarPoints>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Scan {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Scan {
    /// One that never has to grow. What is never written costs no memory.
    pub fn with_room() -> Self {
        let mut scan = Self::default();
        scan.items.reserve(RadarPoints::MAX_ITEMS);
        scan
    }

    /// Copies a message into the memory that is there.
    pub fn copy_from(&mut self, from: MessageRef<'_, RadarPoints>) {
        *self.head = *from.head;
        self.items.clear();
        let count = from.items.len().min(RadarPoints::MAX_ITEMS);
        self.items.extend_from_slice(&from.items[..count]);
    }

    /// Makes all stamps of the sweep earlier.
    pub fn shift_earlier(&mut self, by_ns: i64) {
        let head = &mut *self.head;
        head.header.stamp_ns = head.header.stamp_ns.saturating_sub(by_ns);
        head.sweep.begin_ns = head.sweep.begin_ns.saturating_sub(by_ns);
        head.sweep.end_ns = head.sweep.end_ns.saturating_sub(by_ns);
        let count = head.sweep.beams().len();
        for beam in head.sweep.beams.iter_mut().take(count) {
            beam.stamp_ns = beam.stamp_ns.saturating_sub(by_ns);
        }
    }
}

impl Persist for Scan {
    fn save(&self, out: &mut Writer<'_>) {
        let used = BEFORE_BEAMS + size_of_val(self.head.sweep.beams());
        let head = bytemuck::bytes_of(&*self.head);
        used.save(out);
        out.bytes(head.get(..used).unwrap_or_default());
        self.items.len().save(out);
        out.bytes(bytemuck::cast_slice(&self.items));
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let (mut used, mut count) = (0_usize, 0_usize);
        used.restore(from)?;
        *self.head = PointsHead::default();
        let head = bytemuck::bytes_of_mut(&mut *self.head);
        let head = head.get_mut(..used).ok_or(Error::Unsound("scan"))?;
        head.copy_from_slice(from.bytes(used)?);
        count.restore(from)?;
        if count > RadarPoints::MAX_ITEMS || !is_sweep(self.as_ref()) {
            return Err(Error::Unsound("scan"));
        }
        self.items.clear();
        let items = from.bytes(count * size_of::<Return>())?;
        let items = items.chunks_exact(size_of::<Return>());
        self.items
            .extend(items.map(bytemuck::pod_read_unaligned::<Return>));
        Ok(())
    }
}
