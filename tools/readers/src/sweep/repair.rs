//! Checks a sweep that came from a log: its table and its numbers.

use crate::counters::Counters;
use crate::limit::{is_instant, no_instant};
use randt_messages::{MAX_BEAMS, Message, RadarScan};

/// Longest plausible sweep: a turn a minute.
const SWEEP_MAX_NS: i64 = 60_000_000_000;

/// Repairs a sweep by leaving out returns that are not finite; false where its table is broken.
pub(crate) fn repair(scan: &mut Message<RadarScan>, counters: &mut Counters) -> bool {
    let sequence = scan.head.header.sequence;
    if let Some(why) = broken(scan) {
        counters.count_loss("sweeps_malformed", 1, || format!("sweep {sequence}: {why}"));
        return false;
    }
    let before = scan.items.len();
    let finite = |r: &randt_messages::Return| r.range_m.is_finite() && r.intensity.is_finite();
    if scan.items.iter().all(finite) {
        return true;
    }
    scan.items.retain(finite);
    let left_out = (before - scan.items.len()) as u32;
    let first = || format!("a NaN or infinite value in sweep {sequence}");
    counters.count_event("returns_not_finite", left_out.into(), first);
    let sweep = &mut scan.head.sweep;
    sweep.returns_dropped = sweep.returns_dropped.saturating_add(left_out);
    find_first_returns(scan);
    true
}

/// Sets the beams' first returns anew, after some were left out.
pub(crate) fn find_first_returns(scan: &mut Message<RadarScan>) {
    let sweep = &mut scan.head.sweep;
    let count = sweep.beam_count as usize;
    for (index, beam) in sweep.beams.iter_mut().enumerate().take(count) {
        beam.first_return = scan.items.partition_point(|r| usize::from(r.beam) < index) as u32;
    }
}

/// What is wrong with a sweep's table.
fn broken(scan: &Message<RadarScan>) -> Option<String> {
    let sweep = &scan.head.sweep;
    let total = scan.items.len();
    if sweep.beam_count as usize > MAX_BEAMS {
        return Some(format!("{} beams, {MAX_BEAMS} at most", sweep.beam_count));
    }
    let (begin_ns, end_ns) = (sweep.begin_ns, sweep.end_ns);
    let stamps = [begin_ns, end_ns, scan.head.header.stamp_ns];
    if let Some(stamp_ns) = stamps.into_iter().find(|stamp_ns| !is_instant(*stamp_ns)) {
        return Some(no_instant(stamp_ns));
    }
    if !(0..=SWEEP_MAX_NS).contains(&(end_ns - begin_ns)) {
        return Some(format!(
            "lasts from {begin_ns} to {end_ns}; expected 0 to {SWEEP_MAX_NS} ns"
        ));
    }
    if !sweep.azimuth_step_rad.is_finite() || !sweep.range_resolution_m.is_finite() {
        return Some("a step of azimuth or range that is not finite".to_owned());
    }
    let mut covered = 0;
    for (index, beam) in sweep.beams().iter().enumerate() {
        let returns = sweep.returns_of(index, total);
        let own = scan.items.get(returns.clone()).unwrap_or_default();
        let fits = beam.first_return as usize == covered
            && beam.azimuth_rad.is_finite()
            && (begin_ns..=end_ns).contains(&beam.stamp_ns)
            && own.iter().all(|r| usize::from(r.beam) == index);
        if !fits {
            return Some(format!(
                "beam {index}: its returns, its azimuth or its stamp do not fit the sweep"
            ));
        }
        covered = returns.end;
    }
    (covered != total).then(|| format!("{covered} of {total} returns belong to a beam"))
}
