//! One cell of the bench: a drive under a fault, computed and held against the truth.

use super::figures::Figures;
use super::map_errors::MapErrors;
use super::stretches::{HeldScan, Stretches};
use super::twin::Twin;
use crate::faults::{Fault, FaultInjector, Injection, Span};
use nalgebra::Matrix3;
use randt::drive::Drive;
use randt::job::{self, Done};
use randt::judgement::Judgement;
use randt::trust_spans;
use randt_config::Config;
use randt_evaluation::{
    DirectionalSupport, Motion, MotionErrors, NormalizedError, ScanEstimate, ScanTrust, Trajectory,
    Transform, changes_per_minute, normalized_errors, seconds_until, silently_wrong,
};
use randt_geometry::Pose2;
use randt_geometry::elementary::{PI, wrap};
use randt_messages::{Beam, Localizability, Message, OdometryState, RadarScan, Trust, TruthPose};
use randt_readers::{Counter, Error, Event, InputInfo, Source};
use std::collections::BTreeMap;

/// Time after a fault's end in which it may still be flagged, ns.
const FLAGGED_MAX_NS: i64 = 30_000_000_000;
/// A kidnapping that is flagged within this time opens a new frame of the truth, ns: no window is
/// judged over it then.
const SPLICE_FLAGGED_MAX_NS: i64 = 5_000_000_000;
/// A step of the truth that no robot drives, m: the truth comes every 20 ms.
const SPLICE_M: f64 = 0.5;

/// What is wrong with a drive.
pub(super) struct Faulty {
    pub fault: Fault,
    pub injection: Injection,
}

/// Computes one drive under one fault.
pub(super) fn measure(
    drive: &Drive,
    config: &Config,
    faulty: Faulty,
    undisturbed: Option<&Twin>,
) -> anyhow::Result<Option<Figures>> {
    let Faulty { fault, injection } = faulty;
    let mut source = Observed {
        source: FaultInjector::new(drive.source(), injection),
        drive,
        truth: Vec::new(),
        supports: BTreeMap::new(),
    };
    let mut done = job::run(
        &mut source,
        config,
        fault.has_imu(),
        &indicatif::ProgressBar::hidden(),
    )?;
    if done.interrupted {
        return Ok(None);
    }
    done.finish();
    let Observed {
        source,
        truth,
        supports,
        ..
    } = source;
    figures(&done, &truth, &supports, (source.span(), undisturbed)).map(Some)
}

/// What a source gives after the fault, with what the simulation knows.
struct Observed<'a, S> {
    source: FaultInjector<S>,
    drive: &'a Drive,
    truth: Vec<TruthPose>,
    /// By the scan's sequence number.
    supports: BTreeMap<u64, DirectionalSupport>,
}

impl<S: Source> Source for Observed<'_, S> {
    fn info(&self) -> &InputInfo {
        self.source.info()
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        let event = self.source.next_event()?;
        match &event {
            Some(Event::Truth(pose)) => self.truth.push(*pose),
            Some(Event::Scan(scan)) => {
                let sequence = scan.head.header.sequence;
                let support = support(self.drive, sequence, scan);
                self.supports.insert(sequence, support);
            }
            _ => {}
        }
        Ok(event)
    }

    fn counters(&self) -> Vec<Counter> {
        self.source.counters()
    }
}

/// What the beams that a fault has left of a scan say of the weaker direction.
fn support(drive: &Drive, sequence: u64, scan: &Message<RadarScan>) -> DirectionalSupport {
    let (sweep, total) = (&scan.head.sweep, scan.items.len());
    let step_rad = f64::from(sweep.azimuth_step_rad);
    let sees = |(index, beam): (usize, &Beam)| {
        let turned_rad = f64::from(beam.azimuth_rad) + PI;
        let number = (turned_rad / step_rad).round() as u16;
        (!sweep.returns_of(index, total).is_empty()).then_some(number)
    };
    let beams: Vec<u16> = sweep.beams().iter().enumerate().filter_map(sees).collect();
    let surfaces = drive.surfaces(sequence).iter();
    let left = surfaces.filter(|surface| beams.binary_search(&surface.beam).is_ok());
    DirectionalSupport::from_normals(left.map(|surface| surface.normal.into()))
}

/// The truth as a trajectory. Where it jumps, a robot was carried: a new frame begins there if
/// that was flagged.
fn trajectory(truth: &[TruthPose], scans: &[ScanTrust], frames: &[OdometryState]) -> Trajectory {
    let mut trajectory = Trajectory::stamped();
    let mut frame = 0;
    let mut before: Option<Pose2> = None;
    for pose in truth {
        let (stamp_ns, now) = (pose.header.stamp_ns, Pose2::from_array(pose.pose));
        let jumps = before.is_some_and(|b| b.between(&now).translation().norm() > SPLICE_M);
        if jumps && is_flagged(scans, frames, stamp_ns) {
            frame += 1;
        }
        trajectory.push(stamp_ns, frame, now);
        before = Some(now);
    }
    trajectory
}

/// Whether soon after an instant trust is not good, or a new frame begins.
fn is_flagged(scans: &[ScanTrust], states: &[OdometryState], from_ns: i64) -> bool {
    let end_ns = from_ns + SPLICE_FLAGGED_MAX_NS;
    let mut pairs = states.windows(2);
    seconds_until(scans, false, from_ns, end_ns).is_some()
        || pairs.any(|pair| match pair {
            [a, b] => {
                let range_ns = from_ns..=end_ns;
                a.odom_frame_id != b.odom_frame_id && range_ns.contains(&b.header.stamp_ns)
            }
            _ => false,
        })
}

fn figures(
    done: &Done,
    truth: &[TruthPose],
    supports: &BTreeMap<u64, DirectionalSupport>,
    (fault, undisturbed): (Option<Span>, Option<&Twin>),
) -> anyhow::Result<Figures> {
    let (results, mapper) = (&done.results, done.pipeline.mapper());
    let states = &results.states;
    let trusts: Vec<ScanTrust> = states.iter().map(scan_trust).collect();
    let truth = trajectory(truth, &trusts, states);
    let odometry = results.odometry();
    let spans = trust_spans::for_evaluation(&trust_spans::from_states(states));
    let silent = silently_wrong(&odometry, &truth, &spans);
    let judgement = Judgement::from_run(done)?;
    let live = results.evaluation(&odometry);
    let estimates: Vec<ScanEstimate> = states.iter().map(scan_estimate).collect();
    let errors = normalized_errors(&estimates, &truth);
    let nees = |motion| mean(errors.iter().filter(|e| e.motion == motion).map(|e| e.nees));
    let inside = errors.iter().map(|e| f64::from(u8::from(e.is_inside())));

    let held_scans: Vec<HeldScan> = states
        .iter()
        .zip(&trusts)
        .filter_map(|(state, trust)| {
            let support = *supports.get(&state.scan_sequence)?;
            let there = truth_at(results.truth(), trust.stamp_ns)?;
            Some(HeldScan {
                trust: *trust,
                support,
                position_m: [there.x_m, there.y_m],
                estimate: scan_estimate(state),
                direction_error_rad: direction_error_rad(state, there, &support),
            })
        })
        .collect();
    let share = |count: usize, of: usize| (of > 0).then(|| count as f64 / of as f64);
    let held_count = held_scans
        .iter()
        .filter(|scan| scan.support.is_held())
        .count();
    let good = held_scans.iter().filter(|scan| scan.trust.good);
    let good_held = good.filter(|scan| scan.support.is_held()).count();
    let stretches = Stretches::from_scans(&held_scans, &MotionErrors::new(&truth));
    let map = MapErrors::new(mapper, &truth);
    let loops = judgement.loops.as_ref();
    let last_ns = trusts.last().map_or(0, |scan| scan.stamp_ns);
    let flagged = fault.and_then(|fault| {
        let end_ns = fault.end_ns.saturating_add(FLAGGED_MAX_NS);
        seconds_until(&trusts, false, fault.begin_ns, end_ns)
    });
    let again = fault.and_then(|fault| seconds_until(&trusts, true, fault.end_ns, last_ns));
    let first_ns = trusts.first().map_or(0, |scan| scan.stamp_ns);
    let onset_ns = fault.map_or(first_ns, |fault| fault.begin_ns);
    let since_onset_s = |at_ns: i64| (at_ns - onset_ns) as f64 * 1e-9;
    let count = |count: usize| Some(count as f64);
    Ok(Figures {
        duration_s: Some((last_ns - first_ns) as f64 * 1e-9),
        path_m: Some(judgement.evaluation.path_m),
        silent_m: Some(silent.silent_m as f64),
        wrong_m: Some(silent.wrong_m as f64),
        worst_good_10s_m: Some(silent.worst_good_10s_m),
        heading_deg: Some(silent.worst_good_heading_deg),
        loops: loops.map(|l| l.loops as f64),
        false_loops: loops.map(|l| l.false_loops.len() as f64),
        recall: loops.and_then(|l| l.recall),
        frames: count(results.frames().len()),
        unjoined: count(mapper.components().saturating_sub(1)),
        held: share(held_count, held_scans.len()),
        good: silent.good_share,
        good_of_held: share(good_held, held_count),
        changes_per_min: changes_per_minute(&trusts),
        nees_mean: mean(errors.iter().map(|e| e.nees)),
        nees_median: median(&errors),
        nees_inside: mean(inside),
        nees_straight: nees(Motion::Straight),
        nees_turn: nees(Motion::Turn),
        nees_standstill: nees(Motion::Standstill),
        map_nees: map.first.nees,
        map_inside: map.first.inside,
        map_yaw_nees: map.first.yaw_nees,
        map_pairs_nees: map.pairs.nees,
        map_pairs_inside: map.pairs.inside,
        flagged_s: flagged,
        good_again_s: again,
        effect_s: undisturbed
            .and_then(|twin| twin.effect_ns(states, onset_ns))
            .map(since_onset_s),
        named_s: done.imu_fault_ns.map(since_onset_s),
        stretches: count(stretches.count),
        stretches_late: count(stretches.late),
        stretch_flagged_s: stretches.flagged_s,
        stretch_flagged_m: stretches.flagged_m,
        direction_deg: stretches.direction_deg,
        stretch_inside: stretches.inside,
        stretch_axis_per_error: stretches.axis_per_error,
        stretch_return_m: stretches.return_m,
        stretch_good_again_s: stretches.good_again_s,
        live_ate_m: live.and_then(|e| e.ate_rmse_m),
        final_ate_m: judgement.evaluation.ate_rmse_m,
    })
}

fn scan_trust(state: &OdometryState) -> ScanTrust {
    ScanTrust {
        stamp_ns: state.header.stamp_ns,
        trust: state.trust,
        good: state.trust() == Trust::Good,
    }
}

fn scan_estimate(state: &OdometryState) -> ScanEstimate {
    ScanEstimate {
        stamp_ns: state.header.stamp_ns,
        frame: state.odom_frame_id,
        pose: Pose2::from_array(state.pose),
        covariance: Matrix3::from_row_slice(&state.covariance),
    }
}

/// How far the direction that a state calls weak is off that of the surfaces, rad, 0 to pi/2: a
/// direction has no sign.
fn direction_error_rad(
    state: &OdometryState,
    there: Transform,
    support: &DirectionalSupport,
) -> Option<f64> {
    let named = (state.localizability() == Localizability::Partial).then_some(state);
    let named_rad = there.pose().yaw_rad + named?.weak_direction_rad;
    let off_rad = wrap(2.0 * (named_rad - support.weak_direction_rad));
    Some(0.5 * off_rad.abs())
}

/// The nearest true pose up to an instant.
fn truth_at(truth: &Trajectory, stamp_ns: i64) -> Option<Transform> {
    let poses = truth.poses();
    let after = poses.partition_point(|pose| pose.stamp_ns <= stamp_ns);
    poses.get(after.checked_sub(1)?).map(|pose| pose.transform)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn median(errors: &[NormalizedError]) -> Option<f64> {
    super::summary::median(errors.iter().map(|error| error.nees).collect())
}
