//! A filtered scan as odometry keeps it: checked, in memory of its own, saved without what the message leaves empty.

use crate::heading::STAMPS_NS;
use randt_messages::{Message, MessageRef, PointsHead, RadarPoints, Return, SweepHead, Topic};
use randt_persist::{Error, Persist, Reader, Writer};

/// Longest sweep, ns: the slowest radars turn once in seconds.
const SWEEP_MAX_NS: i64 = 60_000_000_000;
/// Bytes of the head before its table of beams, which is mostly empty.
const BEFORE_BEAMS: usize =
    core::mem::offset_of!(PointsHead, sweep) + core::mem::offset_of!(SweepHead, beams);

/// Whether a scan's times can be.
pub fn is_sweep(scan: MessageRef<'_, RadarPoints>) -> bool {
    let sweep = &scan.head.sweep;
    STAMPS_NS.contains(&sweep.end_ns)
        && (0..=SWEEP_MAX_NS).contains(&(sweep.end_ns.saturating_sub(sweep.begin_ns)))
}

/// A message that never has to grow. What is never written costs no memory.
pub fn with_room() -> Message<RadarPoints> {
    let mut message = Message::default();
    message.items.reserve(RadarPoints::MAX_ITEMS);
    message
}

/// Copies a scan into memory that is there.
pub fn copy(from: MessageRef<'_, RadarPoints>, to: &mut Message<RadarPoints>) {
    *to.head = *from.head;
    to.items.clear();
    to.items
        .extend_from_slice(&from.items[..from.items.len().min(RadarPoints::MAX_ITEMS)]);
}

/// Makes all stamps of a sweep earlier by so much.
pub fn earlier(scan: &mut Message<RadarPoints>, by_ns: i64) {
    let head = &mut *scan.head;
    head.header.stamp_ns = head.header.stamp_ns.saturating_sub(by_ns);
    head.sweep.begin_ns = head.sweep.begin_ns.saturating_sub(by_ns);
    head.sweep.end_ns = head.sweep.end_ns.saturating_sub(by_ns);
    let count = head.sweep.beams().len();
    for beam in head.sweep.beams.iter_mut().take(count) {
        beam.stamp_ns = beam.stamp_ns.saturating_sub(by_ns);
    }
}

/// Saves a scan.
pub fn save(scan: &Message<RadarPoints>, out: &mut Writer<'_>) {
    let used = BEFORE_BEAMS + size_of_val(scan.head.sweep.beams());
    let head = bytemuck::bytes_of(&*scan.head);
    used.save(out);
    out.bytes(head.get(..used).unwrap_or_default());
    scan.items.len().save(out);
    out.bytes(bytemuck::cast_slice(&scan.items));
}

/// Restores a scan into memory that is there.
pub fn restore(scan: &mut Message<RadarPoints>, from: &mut Reader<'_>) -> Result<(), Error> {
    let (mut used, mut count) = (0_usize, 0_usize);
    used.restore(from)?;
    *scan.head = PointsHead::default();
    let head = bytemuck::bytes_of_mut(&mut *scan.head);
    let head = head.get_mut(..used).ok_or(Error::Unsound("scan"))?;
    head.copy_from_slice(from.bytes(used)?);
    count.restore(from)?;
    if count > RadarPoints::MAX_ITEMS || !is_sweep(scan.as_ref()) {
        return Err(Error::Unsound("scan"));
    }
    scan.items.clear();
    let items = from.bytes(count * size_of::<Return>())?;
    let items = items.chunks_exact(size_of::<Return>());
    scan.items
        .extend(items.map(bytemuck::pod_read_unaligned::<Return>));
    Ok(())
}
