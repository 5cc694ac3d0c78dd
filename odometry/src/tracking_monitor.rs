//! Whether the scans still track their submap: how far a pose can be believed.

use crate::{
    localizability::Localizability,
    recent_drift::RecentDrift,
    sliding_window::{Solution, WindowScan},
    tracking_status::TrackingStatus,
};
use nalgebra::Matrix2;
use randt_config::Config;
use randt_geometry::{Pose2, elementary::sin_cos};
use randt_messages::{Localizability as Seen, Return, Trust, TrustReason};
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
/// Scans in a row without support before the pose may be given up.
const LOST_AFTER: u32 = 5;
/// Share of a submap's radius: a pose without support is given up where its standard deviation is
/// more, because the submap is then hardly there.
const COASTING_SHARE: f64 = 0.5;
/// Drift over the last metres above which trust stays away, m: half a metre is wrong.
const DRIFT_MAX_M: f64 = 0.25;
/// Variance that a scan adds where neither its cells nor the IMU hold the position, m^2: what the
/// grid makes of it stands still.
const UNCARRIED_VARIANCE_M2: f64 = 0.01;
/// Returns from which two equal scans are one: noise makes each of them differ.
const FROZEN_MIN: usize = 10;

/// Watches the solutions, scan by scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrackingMonitor {
    unsupported: u32,
    /// The last [`FIT_SCANS`] scans, the newest one the lowest bit: 1 where it fitted poorly.
    poor_fits: u32,
    /// Stamp of the last scan with a reason against its pose.
    doubted_ns: Option<i64>,
    /// Largest variance of the last scan's position, m^2.
    last_variance_m2: f64,
    drift: RecentDrift,
    /// Hash of the last scan's returns, and whether they are those of the one before.
    returns_hash: u64,
    is_frozen: bool,
}

persist!(TrackingMonitor {
    unsupported,
    poor_fits,
    doubted_ns,
    last_variance_m2,
    drift,
    returns_hash,
    is_frozen,
} sound is_sound);

/// Hash of what was measured: multiplications of FNV-1a, a return at a time.
fn hash(returns: &[Return]) -> u64 {
    returns.iter().fold(0xcbf2_9ce4_8422_2325, |hash, r| {
        let measured = u64::from(r.range_m.to_bits()) << 32 | u64::from(r.intensity.to_bits());
        (hash ^ measured ^ u64::from(r.beam).rotate_right(16)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Mean robust weight of a scan below which it fits poorly.
pub fn fit_min(config: &Config) -> f64 {
    let odometry = &config.odometry;
    let loss = AdaptiveLoss::new(odometry.loss_alpha, odometry.loss_scale, 1.0);
    loss.weight(POOR_SQUARED_DISTANCE)
}

impl TrackingMonitor {
    /// Whether it can go on counting, and what it remembers is possible.
    fn is_sound(&self) -> bool {
        self.unsupported <= u32::MAX / 2 && self.poor_fits >> FIT_SCANS == 0
    }

    /// Whether a scan repeats all returns of the one before.
    pub fn is_frozen(&mut self, returns: &[Return]) -> bool {
        let hash = hash(returns);
        self.is_frozen = returns.len() >= FROZEN_MIN && hash == self.returns_hash;
        self.returns_hash = hash;
        self.is_frozen
    }

    /// Adds by how much the position drifted with this scan, where its cells do not hold it.
    fn add_drift(
        &mut self,
        solution: &Solution,
        scan: &WindowScan,
        localizability: Localizability,
    ) {
        let variance_m2 = solution.position_variance_m2();
        let mut grown_m2 = (variance_m2 - self.last_variance_m2).max(0.0);
        self.last_variance_m2 = variance_m2;
        if !scan.is_carried() {
            grown_m2 = grown_m2.max(UNCARRIED_VARIANCE_M2);
        }
        let turn = turn(&scan.state.odom_from_base);
        let drift = turn * localizability.unseen() * turn.transpose() * grown_m2;
        let way_m = scan.state.velocity.xy().norm() * scan.dt_s;
        self.drift.advance(way_m, &drift);
    }

    /// A covariance of the newest position, in the robot's frame, as that against where the robot
    /// was some metres ago.
    pub fn widen(&self, covariance_m2: &Matrix2<f64>, odom_from_base: &Pose2) -> Matrix2<f64> {
        let turn = turn(odom_from_base);
        let turned = turn * covariance_m2 * turn.transpose();
        turn.transpose() * self.drift.widen(&turned) * turn
    }

    /// Judges how far the newest pose can be believed, by its solution and by what else was found
    /// against it, a set of [`TrustReason`].
    pub fn judge(
        &mut self,
        solution: &Solution,
        scan: &WindowScan,
        found: u32,
        config: &Config,
    ) -> TrackingStatus {
        let stamp_ns = scan.message.head.sweep.end_ns;
        let is_supported = solution.fit > 0.0;
        let localizability = if is_supported {
            self.unsupported = 0;
            scan.localizability
        } else {
            self.unsupported += 1;
            Localizability::NONE
        };
        self.add_drift(solution, scan, localizability);
        let is_poor = solution.fit < fit_min(config);
        self.poor_fits = (self.poor_fits << 1 | u32::from(is_poor)) & ((1 << FIT_SCANS) - 1);

        let is_weak = is_supported && localizability.seen != Seen::Full;
        let fits_poorly = self.poor_fits.count_ones() >= POOR_FITS;
        // Where two senders send beams, it is unknown whose beams these are.
        let is_contested = scan.message.head.sweep.is_contested();
        let is_fast = scan.state.velocity.xy().norm() > config.odometry.speed_max_m_s;
        let mut reasons = found
            | TrustReason::Unsupported.bit_if(!is_supported)
            | TrustReason::Weak.bit_if(is_weak)
            | TrustReason::Fit.bit_if(fits_poorly)
            | TrustReason::Repeated.bit_if(self.is_frozen)
            | TrustReason::Contested.bit_if(is_contested)
            | TrustReason::Rate.bit_if(is_fast);
        let is_adrift = self.unsupported >= LOST_AFTER
            && solution.position_variance_m2().sqrt() > COASTING_SHARE * config.submap.radius_m;
        let trust = if is_adrift || is_fast {
            Trust::Lost
        } else {
            if reasons != 0 {
                self.doubted_ns = Some(stamp_ns);
            }
            let is_held = |doubted_ns| stamp_ns.saturating_sub(doubted_ns) < HELD_NS;
            let has_drifted = self.drift.sigma_m() > DRIFT_MAX_M;
            if self.doubted_ns.is_some_and(is_held) || has_drifted {
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

/// From the robot's frame into `odom`, without the way.
fn turn(odom_from_base: &Pose2) -> Matrix2<f64> {
    let (sin, cos) = sin_cos(odom_from_base.yaw_rad);
    Matrix2::new(cos, -sin, sin, cos)
}

#[cfg(test)]
mod tests;
