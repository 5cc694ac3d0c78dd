//! Whether the scans still track their submap: how far a pose can be believed.

use crate::sliding_window::{Solution, WindowScan};
use nalgebra::SymmetricEigen;
use randt_config::Config;
use randt_geometry::marginalize_yaw;
use randt_messages::Trust;
use randt_ndt::AdaptiveLoss;
use randt_persist::persist;

/// A direction is weak where a scan's information along it is below this many times what the grid
/// alone seems to give along a bare wall. Simulated corridors, whose ends are out of sight, have
/// 1.2 to 1.6 times that, places with corners over 16 times; at 5.6 times, 0.07 % of the scans of
/// eleven sound drives are called weak at most.
const WEAK_MAX: f64 = 5.6;
/// A scan fits poorly where its mean robust weight is below that of a cell at this squared
/// distance from its counterpart: 0.40 under the loss of the mixed profile. Of fifteen sound
/// drives one scan in a thousand is below 0.43 to 0.58; scans of a robot that was carried
/// elsewhere, of a frozen radar or under a wrong gyro are below 0.40.
const POOR_SQUARED_DISTANCE: f64 = 4.82;
/// One poor fit may be a passer-by; this many of the last [`FIT_SCANS`] are not.
const POOR_FITS: u32 = 3;
/// Scans whose fits are remembered.
const FIT_SCANS: u32 = 10;
/// How long trust stays away after the last reason against it, ns: five scans, in which a weak
/// direction or a poor fit shows again if it has not passed.
const HELD_NS: i64 = 1_000_000_000;
/// Scans in a row without support before the pose is given up.
const LOST_AFTER: u32 = 5;
/// Cells that a scan needs to fix a pose at all.
const CELLS_MIN: usize = 5;

/// Watches the solutions, scan by scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrackingMonitor {
    unsupported: u32,
    /// The last [`FIT_SCANS`] scans, the newest one the lowest bit: 1 where it fitted poorly.
    poor_fits: u32,
    /// Stamp of the last scan with a reason against its pose.
    doubted_ns: Option<i64>,
}

persist!(TrackingMonitor { unsupported, poor_fits, doubted_ns } sound is_sound);

/// Eigenvalues of the position information that the scan gives by itself, smaller first, 1/m^2;
/// yaw is marginalised.
pub fn position_information(solution: &Solution) -> [f64; 2] {
    let reduced = marginalize_yaw(&solution.scan_information);
    let values = SymmetricEigen::new(reduced).eigenvalues;
    [
        values.x.min(values.y).max(0.0),
        values.x.max(values.y).max(0.0),
    ]
}

/// Information along a bare wall that comes of the grid alone, 1/m^2.
///
/// The squares of size l cut the wall to pieces whose variance along it is l^2 / 12, widened by
/// 1 + slack. Two of them, the scan's and the map's, make 6 / (l^2 (1 + slack)) of information.
/// The scan's correspondences share the weight of the NDT term, each by its robust weight, whose
/// mean is the fit. As the scan's squares move with the robot, it pulls towards standing still.
fn wall_information(fit: f64, config: &Config) -> f64 {
    let cell_m = config.cell_size_m();
    6.0 * config.odometry.ndt_weight * fit / (cell_m * cell_m * (1.0 + config.ndt.slack))
}

/// Mean robust weight of a scan below which it fits poorly.
fn fit_min(config: &Config) -> f64 {
    let odometry = &config.odometry;
    let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0);
    loss.weight(POOR_SQUARED_DISTANCE)
}

impl TrackingMonitor {
    /// Whether it can go on counting, and what it remembers is possible.
    fn is_sound(&self) -> bool {
        self.unsupported <= u32::MAX / 2 && self.poor_fits >> FIT_SCANS == 0
    }

    /// Judges how far the newest pose can be believed, by its solution.
    pub fn judge(&mut self, solution: &Solution, scan: &WindowScan, config: &Config) -> Trust {
        let stamp_ns = scan.message.head.sweep.end_ns;
        let is_supported = scan.cells.len() >= CELLS_MIN && solution.fit > 0.0;
        self.unsupported = if is_supported {
            0
        } else {
            self.unsupported + 1
        };
        let speed_m_s = scan.state.velocity.xy().norm();
        if self.unsupported >= LOST_AFTER || speed_m_s > config.odometry.speed_max_m_s {
            return Trust::Lost;
        }
        let is_poor = solution.fit < fit_min(config);
        self.poor_fits = (self.poor_fits << 1 | u32::from(is_poor)) & ((1 << FIT_SCANS) - 1);
        let [weakest, _] = position_information(solution);
        let is_weak = weakest < WEAK_MAX * wall_information(solution.fit, config);
        // Where two senders send beams, it is unknown whose beams these are.
        let is_contested = scan.message.head.sweep.is_contested();
        if !is_supported || is_weak || is_contested || self.poor_fits.count_ones() >= POOR_FITS {
            self.doubted_ns = Some(stamp_ns);
        }
        match self.doubted_ns {
            Some(doubted_ns) if stamp_ns.saturating_sub(doubted_ns) < HELD_NS => Trust::Degraded,
            _ => Trust::Good,
        }
    }
}

#[cfg(test)]
mod tests;
