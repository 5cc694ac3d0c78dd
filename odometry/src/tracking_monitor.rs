//! Whether the scans still track their submap: how far a pose can be believed.

use crate::{
    localizability::Localizability,
    sliding_window::{Solution, WindowScan},
    tracking_status::TrackingStatus,
};
use randt_config::Config;
use randt_messages::{Localizability as Seen, Trust, TrustReason};
use randt_ndt::AdaptiveLoss;
use randt_persist::persist;

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
pub const CELLS_MIN: usize = 5;

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
    pub fn judge(
        &mut self,
        solution: &Solution,
        scan: &WindowScan,
        config: &Config,
    ) -> TrackingStatus {
        let stamp_ns = scan.message.head.sweep.end_ns;
        let is_supported = scan.cells.len() >= CELLS_MIN && solution.fit > 0.0;
        let localizability = if is_supported {
            self.unsupported = 0;
            Localizability::from_solution(solution, config)
        } else {
            self.unsupported += 1;
            Localizability::NONE
        };
        let is_poor = solution.fit < fit_min(config);
        self.poor_fits = (self.poor_fits << 1 | u32::from(is_poor)) & ((1 << FIT_SCANS) - 1);

        let is_weak = is_supported && localizability.seen != Seen::Full;
        let fits_poorly = self.poor_fits.count_ones() >= POOR_FITS;
        // Where two senders send beams, it is unknown whose beams these are.
        let is_contested = scan.message.head.sweep.is_contested();
        let is_fast = scan.state.velocity.xy().norm() > config.odometry.speed_max_m_s;
        let mut reasons = TrustReason::Unsupported.bit_if(!is_supported)
            | TrustReason::Weak.bit_if(is_weak)
            | TrustReason::Fit.bit_if(fits_poorly)
            | TrustReason::Contested.bit_if(is_contested)
            | TrustReason::Rate.bit_if(is_fast);
        let trust = if self.unsupported >= LOST_AFTER || is_fast {
            Trust::Lost
        } else {
            if reasons != 0 {
                self.doubted_ns = Some(stamp_ns);
            }
            let is_held = |doubted_ns| stamp_ns.saturating_sub(doubted_ns) < HELD_NS;
            if self.doubted_ns.is_some_and(is_held) {
                reasons |= TrustReason::Held.bit_if(reasons == 0);
                Trust::Degraded
            } else {
                Trust::Good
            }
        };
        TrackingStatus {
            trust: trust as u32,
            reasons,
            localizability: localizability.seen as u32,
            weak_direction_rad: localizability.weak_direction_rad,
        }
    }
}

#[cfg(test)]
mod tests;
