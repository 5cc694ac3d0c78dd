//! Odometry: the paper's motion estimation, scan by scan.

use crate::{
    factors::GyroTerm,
    heading::Heading,
    keyframe::{KeyframeMaker, step_covariance},
    slot::{CellMaker, Slot},
    state::{State, StateMatrix},
    submap::Submaps,
    tilt::Tilt,
    trust::{TrustJudge, position_information},
    window::{Prior, Solution, Solver},
};
use nalgebra::{Matrix3, Vector3};
use randt_config::Config;
use randt_geometry::{Pose2, elementary::wrap};
use randt_messages::{
    ImuSample, ImuUse, Keyframe, Message, MessageRef, OdometryState, RadarPoints, Topic, Trust,
};
use randt_ndt::{AdaptiveLoss, Association};
use std::collections::VecDeque;

/// Cells from which a scan can found a map.
const FOUNDING_CELLS: usize = 5;
/// Rounds in which the first scan is de-skewed again with the speed that the second one shows.
const FOUNDING_ROUNDS: u32 = 8;
/// Change of speed below which those rounds end, m/s: 1 mm in a sweep.
const FOUNDING_SPEED_CHANGE_M_S: f64 = 0.005;
/// Speeds tried at a start differ by this share of a cell per scan: the solver's basin is half a cell.
const START_STEP_CELLS: f64 = 0.15;
/// Most speeds tried to each side, so that a start takes milliseconds also where cells are small.
const START_STEPS_MAX: f64 = 60.0;
/// Reverse speeds are tried up to a quarter of the forward ones.
const START_REVERSE_SHARE: i32 = 4;
/// A robot stands at the start unless another speed explains this much more: echoes agree by chance.
const START_GAIN_MIN: f64 = 1.1;
/// The first pose is where it is by definition; a number that keeps the equations regular, m and rad.
const ORIGIN_SIGMA: f64 = 1e-4;
/// Sideways speed and yaw rate at a start, m/s and rad/s: a vehicle drives forward.
const START_SIDEWAYS_SIGMA: f64 = 1.0;
/// Gyro coverage of a sweep may lack this much, s: two samples at 250 Hz.
const UNCOVERED_MAX_S: f64 = 0.01;
/// Scans that may wait for the IMU; a wait of 0.1 s never holds more than one or two.
const PENDING: usize = 4;

/// Where the results go.
pub trait Sink {
    /// The live state after a scan.
    fn state(&mut self, state: &OdometryState);
    /// A keyframe with its final pose.
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>);
}

/// What was dropped, repaired or lacked support.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Scans whose stamp repeats the one before: left out.
    pub scans_repeated: u64,
    /// Scans that found no support in the map, or had too few cells.
    pub scans_unsupported: u64,
    /// Scans for which the IMU ended before the sweep did.
    pub scans_imu_late: u64,
    /// Scans without IMU although there had been one.
    pub scans_without_imu: u64,
    /// Odometry frames opened after the first.
    pub frames_reopened: u64,
    /// Solves without a result.
    pub solver_failures: u64,
    /// IMU samples left out: back in time, repeated, not finite.
    pub imu_rejected: u64,
    /// Holes in the IMU's samples above 0.1 s.
    pub imu_holes: u64,
    /// Points outside of the submap's grid.
    pub points_outside: u64,
}

/// The live estimate from filtered scans and IMU samples, given in order of their stamps.
#[derive(Debug)]
pub struct Odometry {
    config: Config,
    heading: Option<Heading>,
    /// Scans that wait for the IMU, and messages to reuse.
    pending: VecDeque<Message<RadarPoints>>,
    spare: Vec<Message<RadarPoints>>,
    standstill: Option<(f64, f64)>,
    /// One more than the window; the first `used` are in it, oldest first.
    slots: Vec<Slot>,
    used: usize,
    prior: Prior,
    /// The last state that left the window, and whether the frame's first scan did.
    settled: Option<State>,
    inserted: Option<Pose2>,
    solver: Solver,
    submaps: Submaps,
    cells: CellMaker,
    keyframes: KeyframeMaker,
    judge: TrustJudge,
    frame: Frame,
    sequence: u64,
    counters: Counters,
}

/// The odometry frame in force.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    id: u64,
    last_stamp_ns: Option<i64>,
    lost: bool,
}

impl Odometry {
    /// Ready for the first scan. `use_imu`: whether scans wait for IMU samples.
    pub fn new(config: &Config, use_imu: bool) -> Self {
        let window = config.odometry.window.max(1) as usize;
        Self {
            heading: use_imu
                .then(|| Heading::new(&config.attitude, &config.robot, &config.odometry)),
            pending: VecDeque::with_capacity(PENDING),
            spare: Vec::with_capacity(PENDING),
            standstill: None,
            slots: vec![Slot::default(); window + 1],
            used: 0,
            prior: Prior {
                mean: State::default(),
                information: StateMatrix::identity(),
            },
            settled: None,
            inserted: None,
            solver: Solver::new(window),
            submaps: Submaps::new(config),
            cells: CellMaker::new(config),
            keyframes: KeyframeMaker::new(&config.keyframe),
            judge: TrustJudge::default(),
            frame: Frame::default(),
            sequence: 0,
            counters: Counters::default(),
            config: config.clone(),
        }
    }

    /// Takes an IMU sample; scans that waited for it are processed.
    pub fn push_imu(&mut self, sample: &ImuSample, sink: &mut impl Sink) {
        let Some(heading) = &mut self.heading else {
            return;
        };
        if let Some(standstill) = heading.push(sample) {
            self.standstill = Some(standstill);
        }
        self.process_ready(sample.header.stamp_ns, sink);
    }

    /// Takes a filtered scan; it is processed as soon as the IMU covers its sweep, or has kept it waiting too long.
    pub fn push_points(&mut self, scan: MessageRef<'_, RadarPoints>, sink: &mut impl Sink) {
        let mut message = self.spare.pop().unwrap_or_default();
        copy(scan, &mut message);
        let stamp_ns = message.head.header.stamp_ns;
        self.pending.push_back(message);
        self.process_ready(stamp_ns, sink);
    }

    /// Ends: processes what waits and hands the window's scans over.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        while let Some(scan) = self.pending.pop_front() {
            self.step(&scan, sink);
        }
        self.settle_all(sink);
    }

    /// What was dropped, repaired or lacked support so far.
    pub fn counters(&self) -> Counters {
        let mut counters = self.counters;
        counters.points_outside = self.submaps.outside;
        if let Some(heading) = &self.heading {
            (counters.imu_rejected, counters.imu_holes) = (heading.rejected, heading.holes);
        }
        counters
    }

    /// Processes waiting scans that the IMU covers, or that have waited too long by the stamps of the data.
    fn process_ready(&mut self, now_ns: i64, sink: &mut impl Sink) {
        let wait_ns = (self.config.odometry.imu_wait_max_s * 1e9) as i64;
        while let Some(scan) = self.pending.front() {
            let end_ns = scan.head.sweep.end_ns;
            let covered = self
                .heading
                .as_ref()
                .is_none_or(|heading| heading.newest_ns().is_some_and(|t| t >= end_ns));
            // A stamp far back means that the clock was set: nothing more will come for this scan.
            let waited = now_ns > end_ns.saturating_add(wait_ns)
                || now_ns < end_ns.saturating_sub(1_000_000_000);
            if !covered && !waited && self.pending.len() < PENDING {
                return;
            }
            if let Some(scan) = self.pending.pop_front() {
                self.step(&scan, sink);
                self.spare.push(scan);
            }
        }
    }

    /// One scan (paper, III): predict, de-skew, make cells, estimate over the window, judge, publish.
    fn step(&mut self, scan: &Message<RadarPoints>, sink: &mut impl Sink) {
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
        self.frame.last_stamp_ns = Some(stamp_ns);

        let imu_use = self.predict(scan);
        self.slide(sink);
        let solution = self.estimate();
        self.publish(&solution, imu_use, sink);
        self.found_later();
    }

    /// A new odometry frame: nothing of the old one is carried over but the gyro.
    fn open_frame(&mut self, sink: &mut impl Sink) {
        if self.frame.last_stamp_ns.is_some() {
            self.settle_all(sink);
            self.counters.frames_reopened += 1;
            self.frame.id += 1;
        }
        (self.used, self.settled, self.inserted, self.frame.lost) = (0, None, None, false);
        self.judge = TrustJudge::default();
        self.keyframes.restart();
        self.submaps
            .restart(self.keyframes.next_id(), Pose2::IDENTITY);
    }

    /// Puts the scan into the window with its state predicted by motion model and gyro.
    fn predict(&mut self, scan: &Message<RadarPoints>) -> ImuUse {
        let before = self
            .used
            .checked_sub(1)
            .and_then(|i| self.slots.get(i))
            .map(|slot| (slot.state, slot.scan.head.sweep.end_ns));
        let end_ns = scan.head.sweep.end_ns;
        let begin_ns = before.map_or(scan.head.sweep.begin_ns, |(_, last_ns)| {
            last_ns.min(scan.head.sweep.begin_ns)
        });
        let sweep = self
            .heading
            .as_ref()
            .and_then(|heading| heading.turn(begin_ns, end_ns));
        let covered = sweep.is_some_and(|turn| turn.uncovered_s <= UNCOVERED_MAX_S);
        let moment = self
            .heading
            .as_ref()
            .and_then(|heading| heading.moment(end_ns))
            .filter(|_| covered);
        let standstill = self.standstill.take().filter(|_| covered);
        let bias_rad_s = self
            .heading
            .as_ref()
            .map_or(0.0, |heading| heading.bias_rad_s().z);

        let Some(slot) = self.slots.get_mut(self.used) else {
            return ImuUse::None;
        };
        self.used += 1;
        copy(scan.as_ref(), &mut slot.scan);
        slot.gyro_covers_sweep = covered;
        slot.tilt = moment.map_or(Tilt::LEVEL, |(_, tilt)| tilt);
        slot.associations.clear();
        match before {
            Some((last, last_ns)) => {
                slot.dt_s = (end_ns - last_ns) as f64 * 1e-9;
                slot.gyro = moment.and_then(|(rate_rad_s, _)| {
                    let turn = self.heading.as_ref()?.turn(last_ns, end_ns)?;
                    Some(GyroTerm {
                        turn,
                        rate_rad_s,
                        standstill,
                    })
                });
                let mut twist = last.velocity * slot.dt_s;
                let mut velocity = last.velocity;
                if let Some(gyro) = &slot.gyro {
                    twist.z = wrap(gyro.turn.angle_rad - last.bias_rad_s * slot.dt_s);
                    velocity.z = gyro.rate_rad_s - last.bias_rad_s;
                }
                slot.state = State {
                    pose: last.pose.compose(&Pose2::exp(twist)),
                    velocity,
                    bias_rad_s: last.bias_rad_s,
                };
            }
            None => {
                (slot.dt_s, slot.gyro) = (0.0, None);
                let yaw_rate = moment.map_or(0.0, |(rate_rad_s, _)| rate_rad_s - bias_rad_s);
                slot.state = State {
                    pose: Pose2::IDENTITY,
                    velocity: Vector3::new(0.0, 0.0, yaw_rate),
                    bias_rad_s,
                };
                self.prior = start_prior(&slot.state, &self.config);
            }
        }
        match (covered, sweep) {
            (true, _) => ImuUse::Covered,
            (false, Some(turn)) if turn.uncovered_s < (end_ns - begin_ns) as f64 * 1e-9 => {
                self.counters.scans_imu_late += 1;
                ImuUse::Late
            }
            (false, Some(_)) => {
                self.counters.scans_without_imu += 1;
                ImuUse::None
            }
            (false, None) => ImuUse::None,
        }
    }

    /// Where the window is full, lets its oldest scan go: what it says stays as a prior, its points in the submap.
    fn slide(&mut self, sink: &mut impl Sink) {
        if self.used < self.slots.len() {
            return;
        }
        if let [oldest, second, ..] = self.slots.as_slice() {
            let seeded = self.is_founding();
            let marginal = self.solver.marginalise(
                oldest,
                second,
                &self.prior,
                self.submaps.active(),
                seeded,
                &self.config,
            );
            // A window without a solution starts again from where it stands.
            self.prior = marginal.unwrap_or_else(|| start_prior(&second.state, &self.config));
        }
        self.settle_oldest(sink);
    }

    /// Whether the frame's first scan is still in the window: it is then the map itself.
    fn is_founding(&self) -> bool {
        self.settled.is_none()
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
            solution = self.solver.solve(
                slots,
                &self.prior,
                self.submaps.active(),
                founding,
                &self.config,
            );
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

    /// A log may begin while the vehicle drives: the second scan is then metres from the first, and both are skewed.
    /// Tries forward speeds on both at once and starts from the one under which most cells find their like.
    fn search_start_speed(&mut self) {
        let odometry = &self.config.odometry;
        let Some(dt_s) = self.slots.get(1).map(|slot| slot.dt_s) else {
            return;
        };
        let step_m_s = START_STEP_CELLS * self.config.ndt.cell_size_m / dt_s.max(1e-3);
        let steps = (odometry.speed_max_m_s / step_m_s)
            .floor()
            .min(START_STEPS_MAX) as i32;
        let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0);
        let neighbours = odometry.neighbours as usize;
        let standing = self.support_at_speed(0.0, &loss, neighbours) * START_GAIN_MIN;
        let mut best = (standing, 0.0);
        for step in -steps / START_REVERSE_SHARE..=steps {
            let speed_m_s = f64::from(step) * step_m_s;
            let support = self.support_at_speed(speed_m_s, &loss, neighbours);
            if support > best.0 {
                best = (support, speed_m_s);
            }
        }
        self.support_at_speed(best.1, &loss, neighbours);
    }

    /// Sum of the robust weights of the second scan's cells where both scans were made at this forward speed.
    fn support_at_speed(&mut self, speed_m_s: f64, loss: &AdaptiveLoss, neighbours: usize) -> f64 {
        let [first, second, ..] = self.slots.as_mut_slice() else {
            return 0.0;
        };
        let turned = first.state.pose.between(&second.state.pose).yaw_rad;
        (first.state.velocity.x, second.state.velocity.x) = (speed_m_s, speed_m_s);
        let twist = Vector3::new(speed_m_s * second.dt_s, 0.0, turned);
        second.state.pose = first.state.pose.compose(&Pose2::exp(twist));
        self.prepare(0);
        self.prepare(1);
        let [first, second, ..] = self.slots.as_mut_slice() else {
            return 0.0;
        };
        self.submaps.seed(&first.state.pose, &first.points);
        let submap = self.submaps.active();
        let pose = submap.root.between(&second.state.pose);
        Association::find(
            &submap.grid,
            &second.cells,
            &pose,
            neighbours,
            &mut second.associations,
        );
        second
            .associations
            .iter()
            .filter(|a| a.count > 0)
            .map(|a| loss.weight(a.nearest))
            .sum()
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

    /// A first scan with too little in it founds nothing: the next one is the first.
    fn found_later(&mut self) {
        let too_little = self
            .slots
            .first()
            .is_some_and(|slot| slot.cells.len() < FOUNDING_CELLS);
        if self.is_founding() && self.used == 1 && too_little {
            self.used = 0;
        }
    }

    /// Publishes the newest state.
    fn publish(&mut self, solution: &Option<Solution>, imu_use: ImuUse, sink: &mut impl Sink) {
        let Some(slot) = self.used.checked_sub(1).and_then(|i| self.slots.get(i)) else {
            return;
        };
        let covariance = solution
            .as_ref()
            .map_or_else(StateMatrix::zeros, |s| s.covariance);
        let trust = match solution {
            Some(solution) => {
                let speed = slot.state.velocity.xy().norm();
                self.judge
                    .judge(solution, slot.cells.len(), speed, &self.config)
            }
            None => Trust::Degraded,
        };
        if trust != Trust::Good && self.used + usize::from(!self.settled.is_none()) > 1 {
            self.counters.scans_unsupported += 1;
        }
        self.frame.lost = trust == Trust::Lost;
        let mut state = OdometryState::default();
        state.header.sequence = self.sequence;
        state.header.stamp_ns = slot.scan.head.header.stamp_ns;
        state.scan_sequence = slot.scan.head.scan_sequence;
        state.odom_frame_id = self.frame.id;
        state.pose = slot.state.pose.to_array();
        state.velocity = slot.state.velocity.into();
        let bias = self
            .heading
            .as_ref()
            .map_or_else(Vector3::zeros, Heading::bias_rad_s);
        state.gyro_bias_rad_s = [bias.x, bias.y, slot.state.bias_rad_s];
        state.attitude = self
            .heading
            .as_ref()
            .map(Heading::attitude)
            .unwrap_or_default()
            .to_array();
        let pose_covariance: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        for (value, covariance) in state
            .covariance
            .iter_mut()
            .zip(pose_covariance.transpose().iter())
        {
            *value = *covariance;
        }
        let solution = solution.unwrap_or_default();
        state.information_eigenvalues = position_information(&solution);
        state.cost = solution.cost;
        state.imu_sequence = self
            .heading
            .as_ref()
            .and_then(Heading::newest_sequence)
            .unwrap_or(u64::MAX);
        state.imu_use = imu_use as u32;
        state.trust = trust as u32;
        state.points = slot.points.len() as u32;
        state.cells = slot.cells.len() as u32;
        // A weight above 1/2 is within the loss's scale.
        state.inliers = slot
            .associations
            .iter()
            .filter(|a| {
                a.nearest < self.config.odometry.loss_scale * self.config.odometry.loss_scale
            })
            .count() as u32;
        state.iterations = solution.iterations;
        state.submap_id = self.submaps.active().id;
        self.sequence += 1;
        sink.state(&state);
    }

    fn settle_all(&mut self, sink: &mut impl Sink) {
        while self.used > 0 {
            self.settle_oldest(sink);
        }
    }

    /// The oldest scan leaves the window: de-skewed once more by its final state, it becomes a keyframe where one is
    /// due and enters the submaps.
    fn settle_oldest(&mut self, sink: &mut impl Sink) {
        self.deskew(0);
        let Some(slot) = self.slots.first() else {
            return;
        };
        let state = slot.state;
        if let Some(last) = &self.settled {
            let relative = last.pose.between(&state.pose);
            let loss = AdaptiveLoss::new(
                self.config.odometry.loss_alpha,
                self.config.odometry.loss_scale,
                1.0,
            );
            let information =
                crate::window::scan_information(slot, self.submaps.active(), &loss, &self.config);
            self.keyframes.propagate(
                &relative,
                &step_covariance(&information, slot, &self.config.odometry),
            );
        } else {
            // The founding scan was the map; now it enters for good.
            self.submaps.seed(&state.pose, &[]);
        }
        if self.keyframes.is_due(&state.pose) {
            self.submaps
                .open_next(self.keyframes.next_id(), &state.pose);
            let submap = (
                self.submaps.active().id,
                self.submaps.active().root_keyframe,
            );
            sink.keyframe(self.keyframes.make(slot, self.frame.id, submap).as_ref());
        }
        let moved = self.inserted.is_none_or(|last| {
            let relative = last.between(&state.pose);
            relative.translation().norm() >= self.config.submap.insert_distance_m
                || relative.yaw_rad.abs() >= self.config.submap.insert_angle_rad
        });
        if moved {
            self.submaps.insert(&state.pose, &slot.points);
            self.inserted = Some(state.pose);
        }
        self.settled = Some(state);
        self.slots.rotate_left(1);
        self.used -= 1;
    }
}

/// At the start of a frame the pose is known by definition and the speed not at all.
fn start_prior(state: &State, config: &Config) -> Prior {
    let odometry = &config.odometry;
    let speed = odometry.speed_max_m_s;
    let sigma = [
        ORIGIN_SIGMA,
        ORIGIN_SIGMA,
        ORIGIN_SIGMA,
        speed,
        START_SIDEWAYS_SIGMA,
        START_SIDEWAYS_SIGMA,
        odometry.gyro_bias_sigma_rad_s,
    ];
    let information =
        StateMatrix::from_diagonal(&nalgebra::SVector::from(sigma.map(|s| 1.0 / (s * s))));
    Prior {
        mean: *state,
        information,
    }
}

fn copy(from: MessageRef<'_, RadarPoints>, to: &mut Message<RadarPoints>) {
    *to.head = *from.head;
    to.items.clear();
    to.items
        .extend_from_slice(&from.items[..from.items.len().min(RadarPoints::MAX_ITEMS)]);
}
