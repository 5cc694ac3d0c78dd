//! Degenerate stretches: scans in a row in which nothing shows the weaker direction.

use super::summary::quantile;
use randt_evaluation::{DirectionalSupport, MotionErrors, ScanEstimate, ScanTrust};

/// Of that many beams on surfaces that face the weaker direction, or more, an end wall is in
/// sight; it takes more to be held ([`DirectionalSupport::is_held`]).
const VISIBLE_BEAMS: usize = 3;
/// Shorter ones are speckle, or a corner that is passed.
const SCANS_MIN: usize = 10;
/// A stretch is flagged in time within this, s and m.
const FLAGGED_MAX_S: f64 = 1.0;
const FLAGGED_MAX_M: f64 = 1.0;
/// The share of stretches that have to be good again in time, and of directions that have to be
/// right.
const AGAIN_SHARE: f64 = 0.9;

/// One scan.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldScan {
    /// Its trust.
    pub trust: ScanTrust,
    /// What its surfaces say of its weaker direction.
    pub support: DirectionalSupport,
    /// Where the robot truly is.
    pub position_m: [f64; 2],
    /// Where it is thought to be.
    pub estimate: ScanEstimate,
    /// How far the direction that the estimate calls weak is off the weaker one, rad; none where
    /// it calls none so.
    pub direction_error_rad: Option<f64>,
}

/// Those of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Stretches {
    /// How many there are.
    pub count: usize,
    /// Of those, the ones that are flagged late or never.
    pub late: usize,
    /// The slowest: from the last scan with an end wall in sight until trust is not good, or to
    /// the first one that is held again.
    pub flagged_s: Option<f64>,
    /// The same, m of path.
    pub flagged_m: Option<f64>,
    /// Nine of ten scans from then on that name a direction: how far it is off, degrees.
    pub direction_deg: Option<f64>,
    /// Share of the positions from then on, since that scan, inside the ellipse of 95 %.
    pub inside: Option<f64>,
    /// The ellipse's semi-axis over the error at the stretches' ends, both as RMS.
    pub axis_per_error: Option<f64>,
    /// Nine of ten: from the first held scan until trust is good.
    pub good_again_s: Option<f64>,
    /// Nine of ten: error then, since the end wall vanished, m.
    pub return_m: Option<f64>,
}

impl Stretches {
    /// From all scans, in order.
    pub fn from_scans(scans: &[HeldScan], errors: &MotionErrors<'_>) -> Self {
        let mut found = Self::default();
        let (mut again_s, mut return_m) = (Vec::new(), Vec::new());
        let mut direction_deg = Vec::new();
        let (mut inside, mut all, mut axis, mut error) = (0.0, 0.0, 0.0, 0.0);
        let mut begin = 0;
        for run in scans.chunk_by(|a, b| a.support.is_held() == b.support.is_held()) {
            let (first, end) = (begin, begin + run.len());
            begin = end;
            let Some(bare) = first_bare(run).filter(|_| !is_held(run)) else {
                continue;
            };
            found.count += 1;
            // Where a drive begins or ends in one, that side says nothing.
            if let Some(last_visible) = (first + bare).checked_sub(1) {
                let stretch = scans.get(last_visible..end).unwrap_or_default();
                let (after_s, after_m) = until(stretch, false);
                found.flagged_s = Some(found.flagged_s.map_or(after_s, |s| s.max(after_s)));
                found.flagged_m = Some(found.flagged_m.map_or(after_m, |m| m.max(after_m)));
                let is_late = after_s > FLAGGED_MAX_S || after_m > FLAGGED_MAX_M;
                found.late += usize::from(is_late);
            }
            let behind = scans.get(end..).unwrap_or_default();
            if !behind.is_empty() {
                again_s.push(until(behind, true).0);
            }
            let Some(vanished) = (first + bare).checked_sub(1).and_then(|i| scans.get(i)) else {
                continue;
            };
            let since = |scan: &HeldScan| errors.between(&vanished.estimate, &scan.estimate);
            let stretch = scans.get(first + bare..end).unwrap_or_default();
            let directions = stretch.iter().filter_map(|scan| scan.direction_error_rad);
            direction_deg.extend(directions.map(f64::to_degrees));
            for is_inside in stretch.iter().filter_map(|s| since(s)?.is_inside_ellipse()) {
                inside += f64::from(u8::from(is_inside));
                all += 1.0;
            }
            if let Some(last) = stretch.last().and_then(since) {
                axis += last.semi_axis_m() * last.semi_axis_m();
                error += last.distance_m() * last.distance_m();
            }
            let back = behind.iter().find(|scan| scan.trust.good).and_then(since);
            return_m.extend(back.map(|error| error.distance_m()));
        }
        found.direction_deg = quantile(direction_deg, AGAIN_SHARE);
        found.inside = (all > 0.0).then(|| inside / all);
        found.axis_per_error = (error > 0.0).then(|| (axis / error).sqrt());
        found.return_m = quantile(return_m, AGAIN_SHARE);
        found.good_again_s = quantile(again_s, AGAIN_SHARE);
        found
    }
}

/// Whether scans, that are alike in this, are held.
fn is_held(run: &[HeldScan]) -> bool {
    run.first().is_none_or(|scan| scan.support.is_held())
}

/// The first one of enough scans in a row with nothing in sight that shows the weaker direction.
fn first_bare(run: &[HeldScan]) -> Option<usize> {
    let is_bare = |scan: &HeldScan| scan.support.beams < VISIBLE_BEAMS;
    let mut begin = 0;
    for part in run.chunk_by(|a, b| is_bare(a) == is_bare(b)) {
        if part.first().is_some_and(is_bare) && part.len() >= SCANS_MIN {
            return Some(begin);
        }
        begin += part.len();
    }
    None
}

/// Time and path from the first scan to the first one that is good, or not; to the last one where
/// none is.
fn until(scans: &[HeldScan], good: bool) -> (f64, f64) {
    let found = scans.iter().position(|scan| scan.trust.good == good);
    let upto = scans
        .get(..=found.unwrap_or(scans.len().saturating_sub(1)))
        .unwrap_or_default();
    let (Some(first), Some(last)) = (upto.first(), upto.last()) else {
        return (0.0, 0.0);
    };
    let step_m = |pair: &[HeldScan]| match pair {
        [a, b] => {
            let [dx, dy] = [0, 1].map(|axis| b.position_m[axis] - a.position_m[axis]);
            (dx * dx + dy * dy).sqrt()
        }
        _ => 0.0,
    };
    let seconds = (last.trust.stamp_ns - first.trust.stamp_ns) as f64 * 1e-9;
    // Adding zero: a sum of nothing is -0.
    (seconds, upto.windows(2).map(step_m).sum::<f64>() + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use randt_evaluation::Trajectory;
    use randt_geometry::Pose2;
    use std::ops::Range;

    /// Five scans a second at 0.5 m/s; nothing is in sight in `open`, little five scans before and
    /// behind; none is good in `poor`.
    fn drive(open: Range<i64>, poor: Range<i64>) -> Stretches {
        let beams = |index: i64| match index {
            _ if open.contains(&index) => 2,
            _ if (open.start - 5..open.end + 5).contains(&index) => 9,
            _ => 10,
        };
        let scan = |index| HeldScan {
            trust: ScanTrust {
                stamp_ns: index * 200_000_000,
                trust: 0,
                good: !poor.contains(&index),
            },
            support: DirectionalSupport {
                beams: beams(index),
                ..DirectionalSupport::default()
            },
            position_m: [0.1 * index as f64, 0.0],
            // Five per cent of the way are missing.
            estimate: ScanEstimate {
                stamp_ns: index * 200_000_000,
                frame: 0,
                pose: Pose2::new(0.095 * index as f64, 0.0, 0.0),
                covariance: Matrix3::from_diagonal(&[1e-3, 1e-3, 1e-9].into()),
            },
            // None is named in the first half of a stretch.
            direction_error_rad: (index >= 75).then_some(0.1),
        };
        let scans: Vec<HeldScan> = (0..200).map(scan).collect();
        let mut truth = Trajectory::stamped();
        for scan in &scans {
            let [x_m, y_m] = scan.position_m;
            truth.push(scan.trust.stamp_ns, 0, Pose2::new(x_m, y_m, 0.0));
        }
        Stretches::from_scans(&scans, &MotionErrors::new(&truth))
    }

    #[test]
    fn a_stretch_counts_from_where_the_end_wall_vanishes() {
        let close = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-9;
        let found = drive(50..100, 54..110);
        assert_eq!((found.count, found.late), (1, 0));
        assert!(close(found.flagged_s, 1.0) && close(found.flagged_m, 0.5));
        assert!(close(found.good_again_s, 1.0), "{found:?}");
        // 0.25 m of 51 scans, where the ellipse ends at 0.11 m, of 22 scans.
        assert!(close(found.inside, 21.0 / 55.0), "{found:?}");
        assert!(
            close(found.direction_deg, 0.1_f64.to_degrees()),
            "{found:?}"
        );
        assert!(close(found.return_m, 0.305), "{found:?}");
        assert!(
            (found.axis_per_error.unwrap() - 0.1095 / 0.275).abs() < 1e-3,
            "{found:?}"
        );
        assert_eq!(drive(50..100, 55..110).late, 1);
        // It was flagged before.
        assert!(close(drive(50..100, 40..110).flagged_s, 0.0));
        // Never: until it is held again.
        let never = drive(50..100, 0..0);
        assert!(close(never.flagged_s, 11.0) && never.late == 1);
        assert!(close(never.good_again_s, 0.0));
    }

    #[test]
    fn what_is_short_or_lies_at_an_end_is_not_judged() {
        assert_eq!(drive(50..59, 0..0), Stretches::default());
        let at_the_begin = drive(0..50, 0..60);
        assert_eq!((at_the_begin.count, at_the_begin.flagged_s), (1, None));
        assert!(at_the_begin.good_again_s.is_some());
        assert_eq!(drive(150..200, 0..0).good_again_s, None);
    }
}
