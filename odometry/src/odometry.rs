//! Odometry: the paper's motion estimation, scan by scan.

mod arrive;
mod counters;
mod founding;
mod predict;
mod publish;
mod resume;
mod save;
mod settle;

use crate::{
    heading::{Heading, STAMPS_NS},
    imu_queue::ImuQueue,
    keyframe::KeyframeMaker,
    scan,
    slot::{CellMaker, Slot},
    state::{State, StateMatrix},
    submap::Submaps,
    trust::TrustJudge,
    window::{Prior, Problem, Solution, Solver},
};
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, Message, MessageRef, OdometryState, PoseRecord, RadarPoints};
use randt_persist::{StateIdentity, persist};
use std::collections::VecDeque;

pub use arrive::Source;
pub use counters::Counters;

/// Rounds in which the first scan is de-skewed again with the speed that the second one shows.
const FOUNDING_ROUNDS: u32 = 8;
/// Change of speed below which those rounds end, m/s: 1 mm in a sweep.
const FOUNDING_SPEED_CHANGE_M_S: f64 = 0.005;
/// Scans that may wait for the IMU; a wait of 0.1 s never holds more than one or two.
const PENDING: usize = 4;

/// Where the results go.
pub trait Sink {
    /// The live state after a scan.
    fn state(&mut self, state: &OdometryState);
    /// A keyframe with its final pose.
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>);
}

/// The live estimate from filtered scans and IMU samples, each given in order of their stamps.
///
/// How scans and samples interleave has no say in the result, as long as no scan's wait for the IMU runs out.
#[derive(Debug)]
pub struct Odometry {
    config: Config,
    identity: StateIdentity,
    heading: Option<Heading>,
    /// Samples that the heading has not seen yet.
    imu: ImuQueue,
    /// Scans that wait for the IMU, and messages to reuse.
    pending: VecDeque<Message<RadarPoints>>,
    spare: Vec<Message<RadarPoints>>,
    /// Deadline of the last scan that was computed because its wait was over.
    ended_wait_ns: Option<i64>,
    standstill: Option<(f64, f64)>,
    /// One more than the window; the first `used` are in it, oldest first.
    slots: Vec<Slot>,
    used: usize,
    prior: Prior,
    /// The last state that left the window, and whether the frame's first scan did.
    settled: Option<State>,
    /// The scan that left the window since the last state was published: stamp and final pose.
    leaving: Option<(i64, Pose2)>,
    inserted: Option<Pose2>,
    solver: Solver,
    submaps: Submaps,
    cells: CellMaker,
    keyframes: KeyframeMaker,
    judge: TrustJudge,
    frame: Frame,
    /// Number of the next state.
    sequence: u64,
    counters: Counters,
    /// The last state, as far as another process can go on from it alone.
    record: PoseRecord,
    last_scan: Option<Source>,
    last_imu: Option<Source>,
}

/// The odometry frame in force.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    id: u64,
    last_stamp_ns: Option<i64>,
    /// Whether the clock was set back for the scans and not yet for the IMU.
    imu_is_old: bool,
    lost: bool,
    /// Where its first scan stands.
    origin: Pose2,
}

persist!(Frame { id, last_stamp_ns, imu_is_old, lost, origin } sound is_sound);

impl Frame {
    /// Whether there are numbers left, and the stamp is one.
    fn is_sound(&self) -> bool {
        self.id <= u64::MAX / 2 && self.last_stamp_ns.is_none_or(|t| STAMPS_NS.contains(&t))
    }
}

impl Odometry {
    /// Ready for the first scan. `use_imu`: whether scans wait for IMU samples.
    pub fn new(config: &Config, use_imu: bool) -> Self {
        let window = config.odometry.window.max(1) as usize;
        Self {
            heading: use_imu
                .then(|| Heading::new(&config.attitude, &config.robot, &config.odometry)),
            imu: ImuQueue::new(),
            pending: VecDeque::with_capacity(PENDING),
            spare: (0..PENDING).map(|_| scan::with_room()).collect(),
            ended_wait_ns: None,
            standstill: None,
            slots: (0..=window).map(|_| Slot::with_room()).collect(),
            used: 0,
            prior: Prior {
                mean: State::default(),
                information: StateMatrix::identity(),
            },
            settled: None,
            leaving: None,
            inserted: None,
            solver: Solver::new(window),
            submaps: Submaps::new(config),
            cells: CellMaker::new(config),
            keyframes: KeyframeMaker::new(&config.keyframe),
            judge: TrustJudge::default(),
            frame: Frame::default(),
            sequence: 0,
            counters: Counters::default(),
            record: PoseRecord::default(),
            last_scan: None,
            last_imu: None,
            identity: save::identity(config, use_imu),
            config: config.clone(),
        }
    }

    /// What was dropped, repaired or lacked support so far.
    pub fn counters(&self) -> Counters {
        let mut counters = self.counters;
        counters.points_outside = self.submaps.outside;
        if let Some(heading) = &self.heading {
            counters.imu_rejected += heading.rejected;
            counters.imu_holes = heading.holes;
        }
        counters
    }

    /// One scan (paper, III): predict, de-skew, make cells, estimate over the window, judge, publish. So many of the
    /// waiting IMU samples are the scan's.
    fn step(&mut self, scan: &Message<RadarPoints>, samples: usize, sink: &mut impl Sink) {
        let stamp_ns = scan.head.sweep.end_ns;
        if self.frame.last_stamp_ns == Some(stamp_ns) {
            self.counters.scans_repeated += 1;
            return;
        }
        let gap_max_ns = (self.config.odometry.gap_max_s * 1e9) as i64;
        let follows = self
            .frame
            .last_stamp_ns
            .is_some_and(|last| stamp_ns > last && stamp_ns - last <= gap_max_ns);
        if !follows || self.frame.lost {
            self.open_frame(sink);
        }
        self.feed(samples);
        self.frame.imu_is_old = self.imu_is_old(stamp_ns);
        self.frame.last_stamp_ns = Some(stamp_ns);

        let imu_use = self.predict(scan);
        self.slide(sink);
        let solution = self.estimate();
        self.publish(&solution, imu_use, sink);
        self.found_later();
        self.forget();
    }

    /// The heading before the window's oldest sweep is of no more use.
    fn forget(&mut self) {
        let oldest = self.slots.first().filter(|_| self.used > 0);
        if let (Some(heading), Some(oldest)) = (&mut self.heading, oldest) {
            heading.forget_before(oldest.scan.head.sweep.begin_ns);
        }
    }

    /// A new odometry frame: nothing of the old one is carried over but the gyro.
    fn open_frame(&mut self, sink: &mut impl Sink) {
        if self.frame.last_stamp_ns.is_some() {
            self.settle_all(sink);
            self.counters.frames_reopened += 1;
            self.frame.id += 1;
            self.frame.origin = Pose2::IDENTITY;
        }
        (self.used, self.settled, self.inserted, self.frame.lost) = (0, None, None, false);
        self.leaving = None;
        self.judge = TrustJudge::default();
        self.keyframes.restart();
        self.submaps
            .restart(self.keyframes.next_id(), self.frame.origin);
    }

    /// De-skew, cells, least squares; while the map is founded also the first scan's de-skew anew.
    fn estimate(&mut self) -> Option<Solution> {
        let newest = self.used.checked_sub(1)?;
        self.prepare(newest);
        if newest == 0 && self.is_founding() {
            return None;
        }
        if self.is_founding() && newest == 1 {
            self.search_start_speed();
        }
        let rounds = if self.is_founding() {
            FOUNDING_ROUNDS
        } else {
            1
        };
        let mut solution = None;
        for _ in 0..rounds {
            let founding = self.is_founding();
            if founding {
                self.prepare(0);
                self.prepare(newest);
                let first = self.slots.first()?;
                self.submaps.seed(&first.state.pose, &first.points);
            }
            let speed_before = self.slots.first()?.state.velocity;
            let slots = self.slots.get_mut(..self.used)?;
            let predicted = slots.last()?.state;
            let problem = Problem {
                prior: &self.prior,
                submap: self.submaps.active(),
                seeded: founding,
                config: &self.config,
            };
            solution = self.solver.solve(slots, &problem);
            if solution.is_none() {
                self.counters.solver_failures += 1;
                self.slots.get_mut(newest)?.state = predicted;
                break;
            }
            let change = self.slots.first()?.state.velocity - speed_before;
            if change.xy().norm() < FOUNDING_SPEED_CHANGE_M_S {
                break;
            }
        }
        let bias_rad_s = self.slots.get(newest)?.state.bias_rad_s;
        if let Some(heading) = &mut self.heading {
            heading.set_yaw_bias(bias_rad_s);
        }
        solution
    }

    /// De-skews a scan of the window by the present states and makes its cells.
    fn prepare(&mut self, i: usize) {
        self.deskew(i);
        if let Some(slot) = self.slots.get_mut(i) {
            self.cells.make(&slot.points, &mut slot.cells);
        }
    }

    fn deskew(&mut self, i: usize) {
        let previous = i
            .checked_sub(1)
            .and_then(|before| self.slots.get(before))
            .map(|slot| slot.state)
            .or(self.settled);
        let Some(slot) = self.slots.get_mut(i) else {
            return;
        };
        let motion = self.config.odometry.deskew;
        slot.deskew(
            &self.config.robot,
            previous.as_ref().filter(|_| slot.dt_s > 0.0),
            self.heading.as_ref(),
            motion,
        );
    }
}
