//! Odometry: the paper's motion estimation, scan by scan.

mod counters;
mod gyro;
mod persistence;
mod resume;
mod trust;
mod twist;
mod waiting;

use crate::{
    gyro_check::GyroCheck,
    gyro_integrator::GyroIntegrator,
    gyro_measurement::GyroMeasurement,
    initializer::Initializer,
    keyframe_selector::{KeyframeSelector, step_covariance},
    mounting_check::MountingCheck,
    moving_clutter::MovingClutter,
    odometry_frame::OdometryFrame,
    scan_overlap::ScanOverlap,
    sliding_window::{SlidingWindow, Solution},
    state_publisher::{Estimate, StatePublisher},
    submaps::Submaps,
    synchronizer::{MessageId, ScanImuSynchronizer, SynchronizedScan},
    tracking_monitor::TrackingMonitor,
    twist_speed::TwistSpeed,
};
use randt_config::Config;
use randt_geometry::Pose2;
use randt_messages::{
    ImuSample, ImuUse, Keyframe, Message, MessageRef, OdometryState, RadarPoints,
};
use randt_persist::StateIdentity;

pub use counters::Counters;

/// Where the results go.
pub trait Sink {
    /// The live state after a scan.
    fn state(&mut self, state: &OdometryState);
    /// A keyframe with its final pose.
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>);
}

/// The live estimate from filtered scans and IMU samples, each given in order of their stamps.
///
/// Its fields are the steps that a scan goes through, in order, each with what it keeps for the
/// next scan.
///
/// How scans and samples interleave does not change the result, as long as no scan's wait for the
/// IMU runs out.
#[derive(Debug)]
pub struct Odometry {
    config: Config,
    identity: StateIdentity,
    synchronizer: ScanImuSynchronizer,
    /// `None` where no IMU is used.
    gyro: Option<GyroIntegrator>,
    gyro_check: GyroCheck,
    twist: TwistSpeed,
    initializer: Initializer,
    window: SlidingWindow,
    submaps: Submaps,
    clutter: MovingClutter,
    overlap: ScanOverlap,
    tracking: TrackingMonitor,
    keyframes: KeyframeSelector,
    mounting: MountingCheck,
    frame: OdometryFrame,
    publisher: StatePublisher,
    counters: Counters,
}

impl Odometry {
    /// Ready for the first scan. `use_imu`: whether scans wait for IMU samples.
    pub fn new(config: &Config, use_imu: bool) -> Self {
        Self {
            identity: persistence::identity(config, use_imu),
            synchronizer: ScanImuSynchronizer::new(&config.odometry),
            gyro: use_imu
                .then(|| GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry)),
            gyro_check: GyroCheck::new(),
            twist: TwistSpeed::new(),
            initializer: Initializer::new(config),
            window: SlidingWindow::new(config),
            submaps: Submaps::new(config),
            clutter: MovingClutter::new(config),
            overlap: ScanOverlap::new(config),
            tracking: TrackingMonitor::default(),
            keyframes: KeyframeSelector::new(&config.keyframe),
            mounting: MountingCheck::default(),
            frame: OdometryFrame::default(),
            publisher: StatePublisher::default(),
            counters: Counters::default(),
            config: config.clone(),
        }
    }

    /// Takes an IMU sample; scans that waited for it are processed.
    pub fn push_imu(&mut self, sample: &ImuSample, sink: &mut impl Sink) {
        let Some(gyro) = &mut self.gyro else {
            return;
        };
        if let Some(oldest) = self.synchronizer.push_imu(sample, &mut self.counters) {
            gyro.push(&oldest);
        }
        self.process_covered(sink);
    }

    /// Takes a filtered scan; it is processed as soon as the IMU covers its sweep. A later scan
    /// ends the wait of those whose sweep ended `imu_wait_max_s` before its own: in a file there
    /// is no other clock. A process, whose scans may run ahead of their samples, keeps the next
    /// scan back while [`Self::waiting_for_ns`] has one, and [proceeds] when its own clock says
    /// that nothing will come before [`Self::deadline_ns`].
    ///
    /// [proceeds]: Self::proceed
    pub fn push_points(&mut self, points: MessageRef<'_, RadarPoints>, sink: &mut impl Sink) {
        let Some(end_ns) = self.synchronizer.push_scan(points, &mut self.counters) else {
            return;
        };
        self.process_covered(sink);
        while self.synchronizer.is_wait_over(end_ns) {
            self.proceed(sink);
        }
    }

    /// The wait of the first scan that waits is over: it is processed with the IMU samples that
    /// are there, which its state shows.
    pub fn proceed(&mut self, sink: &mut impl Sink) {
        if let Some(scan) = self.synchronizer.take_uncovered(self.gyro.as_ref()) {
            self.process(scan, sink);
        }
        self.process_covered(sink);
    }

    /// Ends: processes the scans that wait and hands the window's scans over.
    pub fn finish(&mut self, sink: &mut impl Sink) {
        while self.waiting_for_ns().is_some() {
            self.proceed(sink);
        }
        // No scan needs the samples that are left, but they are counted.
        self.integrate(self.synchronizer.imu_len());
        self.retire_all(sink);
    }

    /// The last scan that was pushed: a process that comes back pushes those after it.
    pub fn last_scan(&self) -> Option<MessageId> {
        self.synchronizer.last_scan()
    }

    /// The last IMU sample that was pushed.
    pub fn last_imu(&self) -> Option<MessageId> {
        self.synchronizer.last_imu()
    }

    /// End of the sweep that waits for the IMU or twists, ns; of the first one where there are
    /// several.
    pub fn waiting_for_ns(&self) -> Option<i64> {
        self.synchronizer.waiting_for_ns()
    }

    /// Until when samples must be published that the first scan that waits may use, by the clock
    /// that publishes: the bounded wait in terms of what the messages carry, so that a log of them
    /// gives the same. `i64::MAX` where the scan was never published.
    pub fn deadline_ns(&self) -> Option<i64> {
        self.synchronizer.deadline_ns()
    }

    /// Processes waiting scans as far as the IMU covers them.
    fn process_covered(&mut self, sink: &mut impl Sink) {
        while let Some(scan) = self.synchronizer.take_covered(self.gyro.as_ref()) {
            self.process(scan, sink);
        }
    }

    fn process(&mut self, synchronized: SynchronizedScan, sink: &mut impl Sink) {
        let SynchronizedScan {
            scan,
            samples,
            twists,
        } = synchronized;
        self.step(&scan, (samples, twists), sink);
        self.synchronizer.recycle(scan);
    }

    /// One scan (RaNDT, III), for which that many of the waiting IMU samples and twists are used.
    fn step(
        &mut self,
        scan: &Message<RadarPoints>,
        (samples, twists): (usize, usize),
        sink: &mut impl Sink,
    ) {
        let end_ns = scan.head.sweep.end_ns;
        if self.synchronizer.last_end_ns() == Some(end_ns) {
            self.counters.scans_repeated += 1;
            return;
        }
        if self.frame.is_lost || !self.follows_last_scan(end_ns, samples) {
            self.open_frame(sink);
        }
        self.integrate(samples);
        self.integrate_twists(twists);
        self.synchronizer.advance(end_ns, self.gyro.as_ref());

        let imu_use = self.predict(scan);
        if self.tracking.is_frozen(&scan.items) {
            self.window.leave_out_returns();
            self.counters.scans_frozen += 1;
        }
        if self.window.is_over_full() {
            let submap = self.submaps.active();
            self.window.marginalize_oldest(submap, &self.config);
            self.retire_oldest(sink);
        }
        self.deskew_and_build_cells();
        let solution = self.estimate();
        let solution = self.check_gyro(solution);
        self.begin_frame_or_wait();
        self.judge(solution.as_ref());
        self.publish(solution, imu_use, sink);

        if self.frame.waits_since_ns.is_some() {
            self.window.restart();
        }
        self.forget_gyro_before_window();
    }

    /// Whether the sweep comes after the last one, without a gap that motion model and gyro cannot
    /// bridge; with that many samples since the last one.
    fn follows_last_scan(&self, end_ns: i64, samples: usize) -> bool {
        let last_ns = self.synchronizer.last_end_ns();
        let has_gyro = self.gyro.is_some() && !self.gyro_check.is_refused();
        let samples = if has_gyro { samples } else { 0 };
        let gap_s = last_ns.map(|last_ns| end_ns.saturating_sub(last_ns) as f64 * 1e-9);
        gap_s.is_some_and(|gap_s| gap_s > 0.0 && self.config.bridges_gap(gap_s, samples))
    }

    /// A new odometry frame: of the old one only the gyro is carried over.
    fn open_frame(&mut self, sink: &mut impl Sink) {
        if self.synchronizer.last_end_ns().is_some() {
            if self.overlap.has_jumped() {
                // Where these are is unknown.
                self.window.restart();
            }
            self.retire_all(sink);
            self.counters.frames_reopened += 1;
            self.frame = OdometryFrame::after(self.frame.id, Pose2::IDENTITY);
        }
        self.frame.is_lost = false;
        self.window.restart();
        self.publisher.set_retired_scan(None);
        self.gyro_check.restart();
        self.clutter.restart();
        self.overlap.restart();
        self.twist.restart();
        self.tracking = TrackingMonitor::default();
        self.keyframes.restart();
        self.submaps
            .restart(self.keyframes.next_id(), self.frame.odom_from_first);
    }

    /// Integrates the oldest of the waiting samples.
    fn integrate(&mut self, samples: usize) {
        let Some(gyro) = &mut self.gyro else {
            return;
        };
        for _ in 0..samples {
            let Some(sample) = self.synchronizer.pop_imu() else {
                return;
            };
            gyro.push(&sample);
        }
    }

    /// Predicts the scan's state by motion model and gyro.
    fn predict(&mut self, scan: &Message<RadarPoints>) -> ImuUse {
        let measured = GyroMeasurement::during_sweep(
            self.gyro.as_mut(),
            &scan.head.sweep,
            self.window.last_end_ns(),
        );
        let gyro = match &self.gyro {
            Some(gyro) => self.gyro_check.admit(measured, gyro.gravity()),
            None => measured,
        };
        self.counters.scans_gyro_refused += u64::from(self.gyro_check.is_refused());
        let is_shifted = self.gyro.as_ref().is_some_and(|gyro| gyro.late_ns() != 0);
        self.counters.scans_gyro_shifted += u64::from(is_shifted);
        self.turn_waiting_frame(scan.head.sweep.end_ns);
        let odom_from_first = self.frame.odom_from_first;
        let last_end_ns = self.window.last_end_ns();
        self.window
            .predict(scan, &gyro, odom_from_first, &self.config);
        self.predict_by_twist(last_end_ns, &gyro);
        gyro.count_imu_use(&mut self.counters)
    }

    /// De-skews the newest scan by its predicted state and builds its NDT cells, without those of
    /// what moves along.
    fn deskew_and_build_cells(&mut self) {
        if let Some(newest) = self.window.len().checked_sub(1) {
            self.window.deskew(newest, self.gyro.as_ref(), &self.config);
            self.window.build_cells(newest, self.submaps.active());
        }
        if let Some(newest) = self.window.newest_mut() {
            self.clutter.take_out(newest);
            self.overlap.observe(newest);
        }
    }

    /// Estimates the window's states; `None` for the first scan of a frame, and where the solver
    /// fails.
    fn estimate(&mut self) -> Option<Solution> {
        let (gyro, config) = (self.gyro.as_ref(), &self.config);
        let solution = if self.initializer.is_running(&self.window) {
            self.initializer
                .estimate(&mut self.window, &mut self.submaps, gyro, config)
        } else {
            self.window.solve(self.submaps.active(), config)
        };
        if solution.is_none() && !self.window.is_first_of_frame() {
            self.counters.solver_failures += 1;
        }
        if let (Some(gyro), Some(newest)) = (&mut self.gyro, self.window.newest()) {
            if let Some(solution) = &solution {
                gyro.set_yaw_bias(newest.state.bias_rad_s, solution.bias_variance());
            }
            let end_ns = newest.message.head.sweep.end_ns;
            let fix = solution
                .as_ref()
                .and_then(|solution| newest.radar_fix(&solution.covariance));
            gyro.observe_scan(end_ns, fix.as_ref());
        }
        self.observe_twist(solution.as_ref());
        solution
    }

    /// Publishes the newest state.
    fn publish(&mut self, solution: Option<Solution>, imu_use: ImuUse, sink: &mut impl Sink) {
        let Some(scan) = self.window.newest() else {
            return;
        };
        let loss_scale = self.config.odometry.loss_scale;
        let estimate = Estimate {
            scan,
            solution,
            is_first_of_frame: self.window.is_first_of_frame(),
            is_waiting: self.frame.is_waiting(),
            imu_use,
            tracking: &self.tracking,
            odom_frame_id: self.frame.id,
            submap_id: self.submaps.active().id,
            inlier_max: loss_scale * loss_scale,
        };
        self.publisher.publish(&estimate, self.gyro.as_ref(), sink);
    }

    fn retire_all(&mut self, sink: &mut impl Sink) {
        while self.window.len() > 0 {
            self.retire_oldest(sink);
        }
    }

    /// The oldest scan leaves the window: de-skewed once more by its final state, it becomes a
    /// keyframe where one is due and enters the submaps.
    fn retire_oldest(&mut self, sink: &mut impl Sink) {
        self.window.deskew(0, self.gyro.as_ref(), &self.config);
        let Some(scan) = self.window.oldest() else {
            return;
        };
        let odom_from_base = scan.state.odom_from_base;
        match self.window.retired() {
            Some(last) => {
                let last_from_base = last.odom_from_base.between(&odom_from_base);
                let step = step_covariance(scan, &self.config);
                self.keyframes.propagate(&last_from_base, &step);
                self.mounting.observe(scan, &last_from_base);
            }
            None => self
                .initializer
                .complete(&mut self.submaps, &odom_from_base),
        }
        if self.keyframes.is_due(&odom_from_base) {
            self.submaps
                .open_next(self.keyframes.next_id(), &odom_from_base);
            let active = self.submaps.active();
            let submap = (active.id, active.root_keyframe);
            let keyframe = self.keyframes.make(scan, self.frame.id, submap);
            sink.keyframe(keyframe.as_ref());
        }
        self.submaps.insert(&odom_from_base, &scan.points);
        let stamp_ns = scan.message.head.header.stamp_ns;
        self.publisher
            .set_retired_scan(Some((stamp_ns, odom_from_base)));
        self.window.pop_oldest();
    }
}
