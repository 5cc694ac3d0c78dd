//! The first scans of a frame: the submap that they initialise, and the speed at which they were
//! made.

use crate::{
    gyro_integrator::GyroIntegrator,
    sliding_window::{SlidingWindow, Solution},
    submaps::Submaps,
};
use nalgebra::Vector3;
use randt_config::Config;
use randt_geometry::Pose2;
use randt_ndt::{AdaptiveLoss, Association};

/// Rounds in which the first scan is de-skewed again with the speed that the later ones show.
const ROUNDS: u32 = 8;
/// Change of speed below which those rounds end, m/s: 1 mm in a sweep.
const SPEED_CHANGE_M_S: f64 = 0.005;
/// Speeds tried at a start differ by this share of a cell per scan: the solver's basin is half a
/// cell.
const STEP_CELLS: f64 = 0.15;
/// Most speeds tried to each side, so that a start takes milliseconds also where cells are small.
const STEPS_MAX: f64 = 60.0;
/// Reverse speeds are tried up to a quarter of the forward ones.
const REVERSE_SHARE: i32 = 4;
/// A robot stands at the start unless another speed explains this much more: echoes agree by
/// chance.
const GAIN_MIN: f64 = 1.1;

/// Estimates as long as the frame's first scan is in the window. That scan is the submap then, and
/// is de-skewed again as its speed becomes known. What it decides by is the window's, so it has no
/// state of its own.
#[derive(Clone, Copy, Debug)]
pub struct Initializer {
    cell_size_m: f64,
    speed_max_m_s: f64,
    neighbours: usize,
    loss: AdaptiveLoss,
}

impl Initializer {
    /// Settings as the window has them.
    pub fn new(config: &Config) -> Self {
        let odometry = &config.odometry;
        Self {
            cell_size_m: config.cell_size_m(),
            speed_max_m_s: odometry.speed_max_m_s,
            neighbours: odometry.neighbours as usize,
            loss: AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0),
        }
    }

    /// Whether it estimates in the window's place.
    pub fn is_running(&self, window: &SlidingWindow) -> bool {
        window.holds_first_scan()
    }

    /// Estimates the window's states, and de-skews the first scan anew by them; `None` for the
    /// frame's first scan.
    pub fn estimate(
        &self,
        window: &mut SlidingWindow,
        submaps: &mut Submaps,
        gyro: Option<&GyroIntegrator>,
        config: &Config,
    ) -> Option<Solution> {
        if window.is_first_of_frame() {
            return None;
        }
        let newest = window.len().checked_sub(1)?;
        if newest == 1 {
            self.search_start_speed(window, submaps, gyro, config);
        }
        let mut solution = None;
        for _ in 0..ROUNDS {
            for i in [0, newest] {
                window.deskew(i, gyro, config);
                window.build_cells(i, submaps.active());
            }
            let first = window.oldest()?;
            submaps.seed(&first.state.odom_from_base, &first.points);
            let speed_before = first.state.velocity;
            solution = window.solve(submaps.active(), config);
            let change = window.oldest()?.state.velocity - speed_before;
            if solution.is_none() || change.xy().norm() < SPEED_CHANGE_M_S {
                break;
            }
        }
        solution
    }

    /// A log may begin while the vehicle drives: the second scan is then metres from the first,
    /// and both are skewed. Tries forward speeds on both at once and starts from the one under
    /// which most cells have a counterpart.
    fn search_start_speed(
        &self,
        window: &mut SlidingWindow,
        submaps: &mut Submaps,
        gyro: Option<&GyroIntegrator>,
        config: &Config,
    ) {
        let Some(dt_s) = window.newest().map(|scan| scan.dt_s) else {
            return;
        };
        let step_m_s = STEP_CELLS * self.cell_size_m / dt_s.max(1e-3);
        let steps = (self.speed_max_m_s / step_m_s).floor().min(STEPS_MAX) as i32;
        let mut support_at =
            |speed_m_s| self.support_at_speed(speed_m_s, window, submaps, gyro, config);
        let mut best = (support_at(0.0) * GAIN_MIN, 0.0);
        for step in -steps / REVERSE_SHARE..=steps {
            let speed_m_s = f64::from(step) * step_m_s;
            let support = support_at(speed_m_s);
            if support > best.0 {
                best = (support, speed_m_s);
            }
        }
        // Leaves both scans at the best speed.
        support_at(best.1);
    }

    /// Sum of the robust weights of the second scan's cells where both scans were made at this
    /// forward speed.
    fn support_at_speed(
        &self,
        speed_m_s: f64,
        window: &mut SlidingWindow,
        submaps: &mut Submaps,
        gyro: Option<&GyroIntegrator>,
        config: &Config,
    ) -> f64 {
        let Some((first, second)) = window.first_two_mut() else {
            return 0.0;
        };
        let odom_from_first = first.state.odom_from_base;
        let turned = odom_from_first
            .between(&second.state.odom_from_base)
            .yaw_rad;
        (first.state.velocity.x, second.state.velocity.x) = (speed_m_s, speed_m_s);
        let twist = Vector3::new(speed_m_s * second.dt_s, 0.0, turned);
        second.state.odom_from_base = odom_from_first.compose(&Pose2::exp(twist));
        for i in [0, 1] {
            window.deskew(i, gyro, config);
            window.build_cells(i, submaps.active());
        }
        let Some((first, second)) = window.first_two_mut() else {
            return 0.0;
        };
        submaps.seed(&odom_from_first, &first.points);
        let submap = submaps.active();
        let submap_from_base = submap.odom_from_root.between(&second.state.odom_from_base);
        Association::find(
            &submap.grid,
            &second.cells,
            &submap_from_base,
            self.neighbours,
            &mut second.associations,
        );
        second
            .associations
            .iter()
            .filter(|a| a.count > 0)
            .map(|a| self.loss.weight(a.nearest))
            .sum()
    }

    /// The frame's first scan leaves the window with its final state: it enters the emptied submap
    /// as every scan does.
    pub fn complete(&self, submaps: &mut Submaps, odom_from_first: &Pose2) {
        submaps.seed(odom_from_first, &[]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gyro_measurement::GyroMeasurement;
    use randt_messages::{Beam, Message, RadarPoints, Return};

    const SWEEP_NS: i64 = 200_000_000;
    const BEAMS: usize = 400;

    /// A sweep in a square room of 12 m, from a robot that drives along x at a constant speed.
    fn sweep(number: i64, speed_m_s: f64) -> Message<RadarPoints> {
        let mut scan = Message::<RadarPoints>::default();
        let sweep = &mut scan.head.sweep;
        (sweep.begin_ns, sweep.end_ns) = ((number - 1) * SWEEP_NS, number * SWEEP_NS);
        sweep.beam_count = BEAMS as u32;
        for beam in 0..BEAMS {
            let stamp_ns = sweep.begin_ns + SWEEP_NS * beam as i64 / BEAMS as i64;
            let azimuth_rad = beam as f64 * core::f64::consts::TAU / BEAMS as f64;
            let (sin, cos) = randt_geometry::elementary::sin_cos(azimuth_rad);
            let x_m = speed_m_s * stamp_ns as f64 * 1e-9;
            let to_x = if cos > 0.0 { 6.0 - x_m } else { -6.0 - x_m } / cos;
            let to_y = if sin > 0.0 { 6.0 } else { -6.0 } / sin;
            sweep.beams[beam] = Beam {
                stamp_ns,
                azimuth_rad: azimuth_rad as f32,
                first_return: 2 * beam as u32,
            };
            for bin in 0..2_u16 {
                scan.items.push(Return {
                    range_m: to_x.min(to_y) as f32 + 0.02 * f32::from(bin),
                    intensity: 9.0 + f32::from(bin),
                    beam: beam as u16,
                    bin,
                });
            }
        }
        scan
    }

    fn started(scans: &[Message<RadarPoints>]) -> (SlidingWindow, Option<Solution>) {
        let config = Config::default();
        let (mut window, mut submaps) = (SlidingWindow::new(&config), Submaps::new(&config));
        let initializer = Initializer::new(&config);
        submaps.restart(0, Pose2::IDENTITY);
        let mut solution = None;
        for (i, scan) in scans.iter().enumerate() {
            let gyro = GyroMeasurement::default();
            window.predict(scan, &gyro, Pose2::IDENTITY, &config);
            window.deskew(i, None, &config);
            window.build_cells(i, submaps.active());
            solution = initializer.estimate(&mut window, &mut submaps, None, &config);
        }
        (window, solution)
    }

    #[test]
    fn two_scans_show_the_speed_of_a_start_on_the_way() {
        let (window, solution) = started(&[sweep(1, 3.0), sweep(2, 3.0)]);
        assert!(solution.is_some());
        let speed_m_s = window.newest().unwrap().state.velocity.x;
        assert!((speed_m_s - 3.0).abs() < 0.2, "{speed_m_s} m/s");
    }

    #[test]
    fn the_first_scan_has_no_solution() {
        let (window, solution) = started(&[sweep(1, 0.0)]);
        assert!(solution.is_none() && window.is_first_of_frame());
    }
}
