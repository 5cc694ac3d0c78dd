//! The window of the last l scans (RaNDT, III-C): their states, the prior of the oldest, and the
//! least squares over them.

mod block_tridiagonal;
mod factors;
mod ndt_builder;
mod ndt_term;
mod prior;
mod solver;
mod state;
mod twist_term;
mod window_scan;
mod without_gyro;

use crate::{
    gyro_integrator::GyroIntegrator, gyro_measurement::GyroMeasurement, submaps::Submap,
    tracking_status::TrackingStatus,
};
use nalgebra::Vector3;
use ndt_builder::NdtBuilder;
use ndt_term::SEEING_MIN;
use prior::Prior;
use randt_config::Config;
use randt_geometry::{Pose2, elementary::wrap};
use randt_messages::{Message, RadarPoints};
use randt_ndt::NormalEquations;
use randt_persist::{Error, Persist, Reader, Writer};
use solver::{Problem, Solver};

pub use solver::Solution;
pub use state::{State, StateMatrix};
pub use twist_term::TwistWay;
pub use window_scan::{CELLS, WindowScan};

/// The window's scans with what is estimated from them.
#[derive(Debug)]
pub struct SlidingWindow {
    /// One more than the window; the first `used` are in it, oldest first.
    scans: Vec<WindowScan>,
    used: usize,
    prior: Prior,
    /// The last state that left the window; `None` while the frame's first scan is in it.
    retired: Option<State>,
    solver: Solver,
    builder: NdtBuilder,
}

impl SlidingWindow {
    /// Empty, with room for all scans.
    pub fn new(config: &Config) -> Self {
        let window = config.odometry.window.max(1) as usize;
        Self {
            scans: (0..=window).map(|_| WindowScan::with_room()).collect(),
            used: 0,
            prior: Prior {
                mean: State::default(),
                information: StateMatrix::identity(),
            },
            retired: None,
            solver: Solver::new(window),
            builder: NdtBuilder::new(config),
        }
    }

    /// Takes every scan out: the next one is the first of a frame.
    pub fn restart(&mut self) {
        (self.used, self.retired) = (0, None);
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Whether there is one scan more than the window has, so that the oldest has to leave.
    pub fn is_over_full(&self) -> bool {
        self.used >= self.scans.len()
    }

    /// Whether the frame's first scan is in the window: it is then the submap itself and has no
    /// NDT term.
    pub fn holds_first_scan(&self) -> bool {
        self.retired.is_none()
    }

    /// Whether the only scan is the frame's first: there is nothing to solve for.
    pub fn is_first_of_frame(&self) -> bool {
        self.used == 1 && self.retired.is_none()
    }

    /// The last state that left the window.
    pub fn retired(&self) -> Option<&State> {
        self.retired.as_ref()
    }

    /// The oldest scan.
    pub fn oldest(&self) -> Option<&WindowScan> {
        self.scans.first().filter(|_| self.used > 0)
    }

    /// The newest scan.
    pub fn newest(&self) -> Option<&WindowScan> {
        self.scans.get(self.used.checked_sub(1)?)
    }

    /// Leaves the newest scan's returns out: they are not of its sweep.
    pub fn leave_out_returns(&mut self) {
        let newest = self.used.checked_sub(1);
        if let Some(scan) = newest.and_then(|newest| self.scans.get_mut(newest)) {
            scan.message.items.clear();
        }
    }

    /// Notes how the newest scan was judged, and the largest variance of its position, m^2.
    pub fn set_status(&mut self, status: TrackingStatus, variance_m2: Option<f64>) {
        let newest = self.used.checked_sub(1);
        let before_m2 = newest
            .and_then(|newest| self.scans.get(newest.checked_sub(1)?))
            .map_or(0.0, |scan| scan.position_variance_m2);
        if let Some(scan) = newest.and_then(|newest| self.scans.get_mut(newest)) {
            scan.status = status;
            scan.position_variance_m2 = variance_m2.unwrap_or(before_m2);
            scan.drift_m2 = (scan.position_variance_m2 - before_m2).max(0.0);
        }
    }

    /// End of the newest scan's sweep, ns.
    pub fn last_end_ns(&self) -> Option<i64> {
        self.newest().map(|scan| scan.message.head.sweep.end_ns)
    }

    /// The frame's first two scans, to be changed together.
    pub fn first_two_mut(&mut self) -> Option<(&mut WindowScan, &mut WindowScan)> {
        match self.scans.as_mut_slice() {
            [first, second, ..] => Some((first, second)),
            _ => None,
        }
    }

    /// Puts a scan into the window, its state predicted by motion model and gyro; the first one of
    /// a frame is at `odom_from_first`.
    pub fn predict(
        &mut self,
        points: &Message<RadarPoints>,
        gyro: &GyroMeasurement,
        odom_from_first: Pose2,
        config: &Config,
    ) {
        let end_ns = points.head.sweep.end_ns;
        let last = self.newest().map(|scan| scan.state).zip(self.last_end_ns());
        let (last_localizability, fixes_way, scans_seeing_all) = self.newest().map_or_else(
            || (Default::default(), true, SEEING_MIN),
            |scan| (scan.localizability, scan.fixes_way, scan.scans_seeing_all),
        );
        let Some(scan) = self.scans.get_mut(self.used) else {
            return;
        };
        self.used += 1;
        scan.message.copy_from(points.as_ref());
        scan.gyro_covers_sweep = gyro.covers_sweep;
        scan.tilt = gyro.tilt;
        (scan.gyro, scan.twist) = (gyro.term, None);
        scan.bias_change = gyro.bias_change;
        scan.associations.clear();
        scan.ndt = NormalEquations::default();
        // Until its cells are compared, it sees what the scan before saw.
        scan.localizability = last_localizability;
        (scan.fixes_way, scan.follows_fix) = (fixes_way, fixes_way);
        scan.scans_seeing_all = scans_seeing_all;
        scan.scans_seeing_all_before = scans_seeing_all;
        scan.leaps = false;
        match last {
            Some((last, last_ns)) => {
                scan.dt_s = (end_ns - last_ns) as f64 * 1e-9;
                let mut twist = last.velocity * scan.dt_s;
                let mut velocity = last.velocity;
                if let Some(speed_change) = scan.speed_change() {
                    for (axis, change_m_s) in speed_change.value_m_s.into_iter().enumerate() {
                        velocity[axis] += change_m_s;
                        twist[axis] += 0.5 * change_m_s * scan.dt_s;
                    }
                }
                let bias_rad_s = last.bias_rad_s + scan.bias_change.mean_rad_s;
                if let Some(gyro) = &scan.gyro {
                    twist.z = wrap(gyro.turn.angle_rad - bias_rad_s * scan.dt_s);
                    velocity.z = gyro.rate_rad_s - bias_rad_s;
                }
                scan.state = State {
                    odom_from_base: last.odom_from_base.compose(&Pose2::exp(twist)),
                    velocity,
                    bias_rad_s,
                };
            }
            None => {
                scan.dt_s = 0.0;
                let yaw_rate = gyro.rate_rad_s.map_or(0.0, |rate| rate - gyro.bias_rad_s);
                scan.state = State {
                    odom_from_base: odom_from_first,
                    velocity: Vector3::new(0.0, 0.0, yaw_rate),
                    bias_rad_s: gyro.bias_rad_s,
                };
                self.prior = Prior::at_start(&scan.state, gyro.bias_sigma_rad_s, config);
            }
        }
    }

    /// De-skews a scan of the window by the present states.
    pub fn deskew(&mut self, i: usize, gyro: Option<&GyroIntegrator>, config: &Config) {
        let previous = i
            .checked_sub(1)
            .and_then(|before| self.scans.get(before))
            .map(|scan| scan.state)
            .or(self.retired);
        if let Some(scan) = self.scans.get_mut(i) {
            scan.deskew(previous.as_ref(), gyro, config);
        }
    }

    /// The newest scan, to be changed.
    pub fn newest_mut(&mut self) -> Option<&mut WindowScan> {
        self.scans.get_mut(self.used.checked_sub(1)?)
    }

    /// Builds the NDT cells of a scan's de-skewed points, cut as it lies in a submap.
    pub fn build_cells(&mut self, i: usize, submap: &Submap) {
        if let Some(scan) = self.scans.get_mut(i) {
            let submap_from_base = submap.odom_from_root.between(&scan.state.odom_from_base);
            self.builder
                .build(&scan.points, &submap_from_base, &mut scan.cells);
        }
    }

    /// Estimates the window's states. Without a solution the newest one stays as it was predicted.
    pub fn solve(&mut self, submap: &Submap, config: &Config) -> Option<Solution> {
        let first_is_map = self.holds_first_scan();
        let scans = self.scans.get_mut(..self.used)?;
        let predicted = scans.last()?.state;
        let problem = Problem {
            prior: &self.prior,
            submap,
            first_is_map,
            config,
        };
        let solution = self.solver.solve(scans, &problem);
        if solution.is_none() {
            scans.last_mut()?.state = predicted;
        }
        solution
    }

    /// Marginalises the oldest state: its terms become the prior of the second one.
    pub fn marginalize_oldest(&mut self, submap: &Submap, config: &Config) {
        let [oldest, second, ..] = self.scans.as_slice() else {
            return;
        };
        let problem = Problem {
            prior: &self.prior,
            submap,
            first_is_map: self.retired.is_none(),
            config,
        };
        let marginal = self.solver.marginalize_oldest(oldest, second, &problem);
        // A window without a solution starts again from its present state.
        let bias_sigma_rad_s = config.odometry.gyro_bias_sigma_rad_s;
        self.prior =
            marginal.unwrap_or_else(|| Prior::at_start(&second.state, bias_sigma_rad_s, config));
    }

    /// Takes the oldest scan out; its state is final.
    pub fn pop_oldest(&mut self) {
        if let Some(oldest) = self.oldest() {
            self.retired = Some(oldest.state);
            self.scans.rotate_left(1);
            self.used -= 1;
        }
    }
}

impl Persist for SlidingWindow {
    fn save(&self, out: &mut Writer<'_>) {
        // Named one by one, so that a new field is not forgotten.
        let Self {
            scans,
            used,
            prior,
            retired,
            solver: _,
            builder: _,
        } = self;
        used.save(out);
        scans.iter().take(*used).for_each(|scan| scan.save(out));
        prior.save(out);
        retired.save(out);
    }

    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.used.restore(from)?;
        // Between two scans there is always room for the next one.
        if self.used >= self.scans.len() {
            return Err(Error::Unsound("window"));
        }
        for scan in self.scans.iter_mut().take(self.used) {
            scan.restore(from)?;
        }
        self.prior.restore(from)?;
        self.retired.restore(from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gyro_integrator::{GyroTerm, Turn};

    const SWEEP_NS: i64 = 200_000_000;

    fn points(number: i64) -> Message<RadarPoints> {
        let mut points = Message::<RadarPoints>::default();
        let sweep = &mut points.head.sweep;
        (sweep.begin_ns, sweep.end_ns) = ((number - 1) * SWEEP_NS, number * SWEEP_NS);
        points
    }

    /// A window with its first scan, which drives forward.
    fn window(config: &Config) -> SlidingWindow {
        let mut window = SlidingWindow::new(config);
        let origin = Pose2::new(1.0, 2.0, 0.0);
        window.predict(&points(1), &GyroMeasurement::default(), origin, config);
        window.scans[0].state.velocity = Vector3::new(2.0, 0.0, 0.5);
        window
    }

    #[test]
    fn a_scan_is_predicted_by_velocity_and_gyro() {
        let config = Config::default();
        let mut window = window(&config);
        assert!(window.is_first_of_frame());
        let measured = GyroMeasurement {
            term: Some(GyroTerm {
                turn: Turn {
                    angle_rad: 0.0,
                    uncovered_s: 0.0,
                },
                rate_rad_s: 0.1,
                standstill: None,
                ..GyroTerm::default()
            }),
            ..GyroMeasurement::default()
        };
        window.predict(&points(2), &measured, Pose2::IDENTITY, &config);
        let newest = window.newest().unwrap();
        // The gyro measured no turn.
        assert!((newest.state.odom_from_base.x_m - 1.4).abs() < 1e-12);
        assert_eq!(newest.state.odom_from_base.yaw_rad, 0.0);
        assert_eq!(newest.state.velocity, Vector3::new(2.0, 0.0, 0.1));
        assert_eq!(newest.dt_s, 0.2);
    }

    #[test]
    fn the_oldest_scan_leaves_when_the_window_is_over_full() {
        let config = Config::default();
        let mut window = window(&config);
        let mut number = 1;
        while !window.is_over_full() {
            number += 1;
            window.predict(
                &points(number),
                &GyroMeasurement::default(),
                Pose2::IDENTITY,
                &config,
            );
        }
        assert_eq!(window.len(), config.odometry.window as usize + 1);
        let oldest = window.oldest().unwrap().state;
        window.pop_oldest();
        assert_eq!(window.retired(), Some(&oldest));
        assert_eq!(window.last_end_ns(), Some(number * SWEEP_NS));
        assert!(!window.holds_first_scan());
        window.restart();
        assert!(window.newest().is_none() && window.holds_first_scan());
    }

    #[test]
    fn a_window_survives_its_process_and_one_without_room_is_refused() {
        let config = Config::default();
        let whole = window(&config);
        let mut bytes = vec![0; 1 << 20];
        whole.save(&mut Writer::new(&mut bytes));
        let mut restored = SlidingWindow::new(&config);
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!(restored.len(), 1);
        assert_eq!(restored.newest().unwrap().state, whole.scans[0].state);
        bytes[..8].copy_from_slice(&(whole.scans.len() as u64).to_le_bytes());
        assert!(restored.restore(&mut Reader::new(&bytes)).is_err());
    }
}
