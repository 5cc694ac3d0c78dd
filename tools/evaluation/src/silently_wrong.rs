//! Silent metres: where the live estimate was wrong while its trust was good.

use crate::timeline::{Instant, Timeline, relative_error};
use crate::{Trajectory, Transform};
use randt_geometry::elementary::wrap;

/// Length of a window, m of the true path.
const WINDOW_M: f64 = 10.0;
/// Length of a window at standstill, and the time after which the next one begins there.
const STANDSTILL_NS: i64 = 30_000_000_000;
/// Time over which the worst error under good trust is searched.
const GOOD_NS: i64 = 10_000_000_000;
/// A robot stands that comes less far than this in [`STANDSTILL_NS`], m: no window begins twice in
/// a metre of path.
const STANDSTILL_M: f64 = 1.0;
/// A window is wrong where the motion over it is off by more, m and degrees: what makes a loop
/// false.
const WRONG_M: f64 = 0.5;
const WRONG_DEG: f64 = 5.0;
/// Where an IMU gives the heading, it may be off since the start of its frame by [`WRONG_DEG`] and
/// this much more for each metre of path.
const HEADING_DEG_PER_M: f64 = 0.01;

/// The trust that is in force from an instant on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrustSpan {
    /// Stamp of its first scan.
    pub begin_ns: i64,
    /// Whether trust is good.
    pub good: bool,
    /// Whether an IMU covered the sweeps.
    pub imu: bool,
}

/// How far a drive was wrong, and how much of that in silence.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SilentlyWrong {
    /// Windows that were trusted and wrong, and besides metres that were driven under good trust
    /// with a wrong heading.
    pub silent_m: u64,
    /// Windows that were wrong, trusted or not.
    pub wrong_m: u64,
    /// Windows in all; one for each metre of the true path.
    pub windows: u64,
    /// Largest error in translation of the motion over 10 s, or less, in which every scan is good,
    /// m.
    pub worst_good_10s_m: f64,
    /// Largest error of the heading, accumulated since its frame began, where trust is good and an
    /// IMU is used, degrees.
    pub worst_good_heading_deg: f64,
    /// Share of the scans whose trust is good, 0..1; `None` where no scan has truth and trust.
    pub good_share: Option<f64>,
}

/// One scan with its pose, the truth and its trust.
struct Scan {
    stamp_ns: i64,
    estimate: Instant,
    truth: Instant,
    trust: TrustSpan,
    /// Error of the heading, accumulated since the frame's start, degrees, and whether it is off.
    heading_error_deg: f64,
    heading_is_off: bool,
}

impl Scan {
    /// Whether the heading is believed.
    fn has_good_heading(&self) -> bool {
        self.trust.good && self.trust.imu
    }
}

/// Counts the silent metres of a live estimate, whose poses are its scans. `trust` is in order of
/// its stamps.
///
/// A window begins at every metre of the true path and is 10 m long; at standstill it begins every
/// 30 s and takes as long. It is trusted where at least half of its scans are good, and wrong
/// where the motion over it is off by more than 0.5 m or 5 degrees. A window that spans a change
/// of frame is not judged, and so not wrong.
pub fn silently_wrong(
    estimate: &Trajectory,
    truth: &Trajectory,
    trust: &[TrustSpan],
) -> SilentlyWrong {
    let scans = scans(estimate, truth, trust);
    let good = scans.iter().filter(|scan| scan.trust.good).count();
    let headings = scans.iter().filter(|scan| scan.has_good_heading());
    let mut found = SilentlyWrong {
        worst_good_10s_m: worst_good_m(&scans),
        worst_good_heading_deg: headings.fold(0.0, |worst, scan| worst.max(scan.heading_error_deg)),
        good_share: (!scans.is_empty()).then(|| good as f64 / scans.len() as f64),
        ..SilentlyWrong::default()
    };
    let mut before: Option<&Scan> = None;
    for (index, scan) in scans.iter().enumerate() {
        let begins = before.map_or(1, |before| begins(before, scan));
        if begins == 0 {
            continue;
        }
        before = Some(scan);
        found.windows += begins;
        let window = window(scans.get(index..).unwrap_or_default());
        let is_wrong = is_wrong(window);
        found.wrong_m += begins * u64::from(is_wrong);
        let heading_is_off = scan.heading_is_off && scan.has_good_heading();
        found.silent_m += begins * u64::from(is_wrong && is_trusted(window) || heading_is_off);
    }
    found
}

/// How many windows begin with a scan, given the one with which the last ones began: one for each
/// metre that was completed since, which are several between two scans of a fast robot.
fn begins(before: &Scan, scan: &Scan) -> u64 {
    let metres = scan.truth.path_m.floor() - before.truth.path_m.floor();
    let stands = scan.stamp_ns.saturating_sub(before.stamp_ns) >= STANDSTILL_NS;
    (metres as u64).max(u64::from(stands))
}

/// Every scan for which there are truth and trust.
fn scans(estimate: &Trajectory, truth: &Trajectory, trust: &[TrustSpan]) -> Vec<Scan> {
    let (thought, there) = (Timeline::new(estimate), Timeline::new(truth));
    let mut heading: Option<HeadingError> = None;
    let poses = estimate.poses().iter();
    poses
        .filter_map(|pose| {
            let stamp_ns = pose.stamp_ns;
            let (estimate, truth) = (thought.at(stamp_ns)?, there.at(stamp_ns)?);
            let after = trust.partition_point(|span| span.begin_ns <= stamp_ns);
            let trust = *trust.get(after.checked_sub(1)?)?;
            let now = HeadingError::new(&estimate, &truth);
            let now = match heading {
                Some(before) => now.after(&before),
                None => now,
            };
            heading = Some(now);
            Some(Scan {
                stamp_ns,
                estimate,
                truth,
                trust,
                heading_error_deg: now.error_deg(),
                heading_is_off: now.is_off(truth.path_m),
            })
        })
        .collect()
}

/// The window that begins with the first of these scans; empty where the drive ends before it
/// does.
fn window(scans: &[Scan]) -> &[Scan] {
    let Some(first) = scans.first() else {
        return &[];
    };
    let reached = |stop: usize| (stop < scans.len()).then_some(stop);
    let later =
        scans.partition_point(|scan| scan.stamp_ns.saturating_sub(first.stamp_ns) < STANDSTILL_NS);
    let driven_m = |scan: &Scan| scan.truth.path_m - first.truth.path_m;
    let stands = |&stop: &usize| {
        scans
            .get(stop)
            .is_some_and(|scan| driven_m(scan) < STANDSTILL_M)
    };
    let far = scans.partition_point(|scan| driven_m(scan) < WINDOW_M);
    let end = reached(later).filter(stands).or(reached(far));
    end.and_then(|end| scans.get(..=end)).unwrap_or_default()
}

/// Whether the motion over a window is off by more than it may be.
fn is_wrong(window: &[Scan]) -> bool {
    error(window).is_some_and(|error| {
        error.distance_m() > WRONG_M || error.angle_rad().to_degrees() > WRONG_DEG
    })
}

/// Error of the motion from the first to the last of these scans; `None` where their frames
/// differ.
fn error(scans: &[Scan]) -> Option<Transform> {
    let (first, last) = (scans.first()?, scans.last()?);
    relative_error(
        (&first.estimate, &first.truth),
        (&last.estimate, &last.truth),
    )
}

/// The largest error of the motion over 10 s of good trust, or over what there is of them.
fn worst_good_m(scans: &[Scan]) -> f64 {
    let frames = |scan: &Scan| [scan.estimate.frame, scan.truth.frame];
    let from = |index: usize| {
        let scans = scans.get(index..)?;
        let first = scans.first()?;
        let good = scans.iter().take_while(|scan| {
            scan.trust.good
                && frames(scan) == frames(first)
                && scan.stamp_ns.saturating_sub(first.stamp_ns) <= GOOD_NS
        });
        let good = scans.get(..good.count())?;
        error(good).map(|error| error.distance_m())
    };
    (0..scans.len()).filter_map(from).fold(0.0, f64::max)
}

/// Whether at least half of a window's scans are good.
fn is_trusted(window: &[Scan]) -> bool {
    let good = window.iter().filter(|scan| scan.trust.good).count();
    2 * good >= window.len()
}

/// How far the heading has run off since its frame began, whole turns included.
#[derive(Clone, Copy, Debug)]
struct HeadingError {
    frames: [u64; 2],
    begin_m: f64,
    error_rad: f64,
    accumulated_rad: f64,
}

impl HeadingError {
    /// At the start of a frame.
    fn new(estimate: &Instant, truth: &Instant) -> Self {
        let yaw_rad = |transform: &Transform| transform.pose().yaw_rad;
        Self {
            frames: [estimate.frame, truth.frame],
            begin_m: truth.path_m,
            error_rad: yaw_rad(&estimate.transform) - yaw_rad(&truth.transform),
            accumulated_rad: 0.0,
        }
    }

    /// The same where it follows another one.
    fn after(self, before: &Self) -> Self {
        if self.frames != before.frames {
            return self;
        }
        let change_rad = wrap(self.error_rad - before.error_rad);
        Self {
            begin_m: before.begin_m,
            accumulated_rad: before.accumulated_rad + change_rad,
            ..self
        }
    }

    fn is_off(&self, path_m: f64) -> bool {
        let most_deg = WRONG_DEG + HEADING_DEG_PER_M * (path_m - self.begin_m);
        self.error_deg() > most_deg
    }

    fn error_deg(&self) -> f64 {
        self.accumulated_rad.abs().to_degrees()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Pose2;

    const SCAN_NS: i64 = 200_000_000;

    /// A scan every 0.2 s, half a metre a second straight on, off by `error`, in a frame.
    fn drive(count: i64, frame: impl Fn(i64) -> u64, error: impl Fn(i64) -> Pose2) -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        for scan in 0..count {
            let at = Pose2::new(0.1 * scan as f64, 0.0, 0.0);
            trajectory.push(scan * SCAN_NS, frame(scan), at.compose(&error(scan)));
        }
        trajectory
    }

    /// 50 m.
    fn truth() -> Trajectory {
        drive(501, |_| 0, |_| Pose2::IDENTITY)
    }

    fn span(scan: i64, good: bool) -> TrustSpan {
        TrustSpan {
            begin_ns: scan * SCAN_NS,
            good,
            imu: true,
        }
    }

    /// The estimate jumps ahead by `jump_m` after 25 m.
    fn jumped(jump_m: f64) -> Trajectory {
        let error = |scan| Pose2::new(if scan < 250 { 0.0 } else { jump_m }, 0.0, 0.0);
        drive(501, |_| 0, error)
    }

    #[test]
    fn windows_are_wrong_from_half_a_metre_on_and_silent_where_they_are_believed() {
        let good = [span(0, true)];
        let right = silently_wrong(&jumped(0.49), &truth(), &good);
        assert_eq!((right.silent_m, right.wrong_m, right.windows), (0, 0, 51));
        assert_eq!(right.good_share, Some(1.0));
        // Windows that begin at 15 m to 24 m see the jump.
        let wrong = silently_wrong(&jumped(0.51), &truth(), &good);
        assert_eq!((wrong.silent_m, wrong.wrong_m), (10, 10));
        assert!((wrong.worst_good_10s_m - 0.51).abs() < 1e-9);
        let judged = silently_wrong(&jumped(0.51), &truth(), &[span(0, false)]);
        assert_eq!(
            (judged.silent_m, judged.wrong_m, judged.good_share),
            (0, 10, Some(0.0))
        );
    }

    #[test]
    fn half_of_a_windows_scans_make_it_believed() {
        // Trust ends at 25 m: windows that begin at 20 m and later are mostly not trusted.
        let trust = [span(0, true), span(250, false)];
        let found = silently_wrong(&jumped(1.0), &truth(), &trust);
        assert_eq!((found.silent_m, found.wrong_m), (5, 10));
        // All of the error lies where trust was not good.
        assert!(found.worst_good_10s_m < 1e-9);
    }

    #[test]
    fn every_metre_of_a_fast_robot_counts() {
        // 3 m a scan, and a jump: windows that begin at 291 m to 300 m see it.
        let (mut truth, mut estimate) = (Trajectory::stamped(), Trajectory::stamped());
        for scan in 0..201_i64 {
            let jump_m = if scan <= 100 { 0.0 } else { 1.0 };
            truth.push(scan * SCAN_NS, 0, Pose2::new(3.0 * scan as f64, 0.0, 0.0));
            let at_m = 3.0 * scan as f64 + jump_m;
            estimate.push(scan * SCAN_NS, 0, Pose2::new(at_m, 0.0, 0.0));
        }
        let found = silently_wrong(&estimate, &truth, &[span(0, true)]);
        assert_eq!((found.windows, found.silent_m), (601, 12));
    }

    #[test]
    fn a_window_over_two_frames_is_not_wrong() {
        let far = |scan| Pose2::new(if scan < 250 { 0.0 } else { 40.0 }, 0.0, 0.0);
        let estimate = drive(501, |scan| u64::from(scan >= 250), far);
        assert_eq!(
            silently_wrong(&estimate, &truth(), &[span(0, true)]).silent_m,
            0
        );
    }

    #[test]
    fn a_heading_that_runs_off_is_silent_though_no_window_is_wrong() {
        // 0.04 degrees a scan: 4 degrees and 0.35 m in ten metres, 20 degrees in fifty.
        let step = Pose2::exp([0.1, 0.0, 0.04_f64.to_radians()].into());
        let (mut estimate, mut pose) = (Trajectory::stamped(), Pose2::IDENTITY);
        for scan in 0..501 {
            estimate.push(scan * SCAN_NS, 0, pose);
            pose = pose.compose(&step);
        }
        let imu = silently_wrong(&estimate, &truth(), &[span(0, true)]);
        // Over 5 degrees and a hundredth a metre from 12.8 m on.
        assert_eq!((imu.silent_m, imu.wrong_m), (38, 0));
        let without = TrustSpan {
            imu: false,
            ..span(0, true)
        };
        assert_eq!(silently_wrong(&estimate, &truth(), &[without]).silent_m, 0);
        assert_eq!(
            silently_wrong(&estimate, &truth(), &[span(0, false)]).silent_m,
            0
        );
    }

    #[test]
    fn a_robot_that_stands_is_judged_every_half_minute() {
        // Two minutes at one position, and the estimate creeps by 2 cm a second from the first
        // minute on.
        let (mut truth, mut estimate) = (Trajectory::stamped(), Trajectory::stamped());
        for scan in 0..601_i64 {
            let creep_m = 0.02 * 0.2 * (scan - 300).max(0) as f64;
            truth.push(scan * SCAN_NS, 0, Pose2::IDENTITY);
            estimate.push(scan * SCAN_NS, 0, Pose2::new(creep_m, 0.0, 0.0));
        }
        let found = silently_wrong(&estimate, &truth, &[span(0, true)]);
        assert_eq!((found.windows, found.silent_m), (5, 2));
    }

    #[test]
    fn nothing_is_said_without_truth_or_trust() {
        let nothing = SilentlyWrong::default();
        assert_eq!(silently_wrong(&truth(), &truth(), &[]), nothing);
        let empty = Trajectory::stamped();
        assert_eq!(silently_wrong(&empty, &truth(), &[span(0, true)]), nothing);
        // What comes before the first span is left out.
        let late = silently_wrong(&truth(), &truth(), &[span(250, true)]);
        assert_eq!(late.windows, 26);
    }
}
