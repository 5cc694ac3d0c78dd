//! Checks a sweep that came from a log: its table and its numbers.

use crate::tally::Tally;
use randt_messages::{MAX_BEAMS, Message, RadarScan};

/// Makes a sweep sound by leaving out returns that are not finite; false where its table is broken.
pub(crate) fn mend(scan: &mut Message<RadarScan>, tally: &mut Tally) -> bool {
    let sequence = scan.head.header.sequence;
    if let Some(why) = broken(scan) {
        tally.lost("sweeps_malformed", 1, || format!("sweep {sequence}: {why}"));
        return false;
    }
    let before = scan.items.len();
    let finite = |r: &randt_messages::Return| r.range_m.is_finite() && r.intensity.is_finite();
    if scan.items.iter().all(finite) {
        return true;
    }
    scan.items.retain(finite);
    let left_out = (before - scan.items.len()) as u32;
    tally.noted("returns_not_finite", u64::from(left_out), || {
        format!("a NaN or infinite value in sweep {sequence}")
    });
    let sweep = &mut scan.head.sweep;
    sweep.returns_dropped = sweep.returns_dropped.saturating_add(left_out);
    let count = sweep.beam_count as usize;
    for (index, beam) in sweep.beams.iter_mut().enumerate().take(count) {
        beam.first_return = scan.items.partition_point(|r| usize::from(r.beam) < index) as u32;
    }
    true
}

/// What is wrong with a sweep's table.
fn broken(scan: &Message<RadarScan>) -> Option<String> {
    let sweep = &scan.head.sweep;
    let total = scan.items.len();
    if sweep.beam_count as usize > MAX_BEAMS {
        return Some(format!("{} beams, {MAX_BEAMS} at most", sweep.beam_count));
    }
    if sweep.begin_ns > sweep.end_ns {
        return Some(format!(
            "begins at {} after its end at {}",
            sweep.begin_ns, sweep.end_ns
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
            && own.iter().all(|r| usize::from(r.beam) == index);
        if !fits {
            return Some(format!(
                "beam {index}: its returns or its azimuth do not fit the table"
            ));
        }
        covered = returns.end;
    }
    (covered != total).then(|| format!("{covered} of {total} returns belong to a beam"))
}
