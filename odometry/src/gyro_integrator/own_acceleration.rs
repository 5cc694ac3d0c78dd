//! How the robot accelerates, as radar and IMU have it: what an accelerometer shows besides
//! gravity.

use crate::inertial_speed::RadarFix;
use nalgebra::{Vector2, Vector3};
use randt_geometry::Pose2;
use randt_persist::persist;

/// Longest time between two scans over which a speed changes evenly, ns.
const STEP_MAX_NS: i64 = 1_000_000_000;

/// Speed and its change over the last scans, in `base_link`. Without it a bend, or a vehicle that
/// gathers speed for seconds, is a slope to the attitude filter: 2 m/s^2 are 11 degrees, which make
/// ranges 2 % shorter.
#[derive(Clone, Debug, Default)]
pub(super) struct OwnAcceleration {
    /// The last scan that the radar fixed: its stamp, ns, and its pose in `odom`.
    last: Option<(i64, Pose2)>,
    /// The speed there, m/s, from the second scan on.
    speed_m_s: Option<Vector2<f64>>,
    /// How it changed since the one before, m/s^2.
    change_m_s2: Vector2<f64>,
}

persist!(OwnAcceleration {
    last,
    speed_m_s,
    change_m_s2,
});

impl OwnAcceleration {
    /// A scan ends here. `None` where the radar does not fix it, which leaves nothing known. The
    /// speed there is the one that the IMU carries, m/s; without it, the radar's since the scan
    /// before, which is ten times as noisy.
    pub fn observe_scan(
        &mut self,
        stamp_ns: i64,
        fix: Option<&RadarFix>,
        carried_m_s: Option<[f64; 2]>,
    ) {
        let now = fix.map(|fix| (stamp_ns, fix.pose));
        let step = self.last.zip(now).and_then(|((last_ns, last), (_, pose))| {
            let dt_ns = stamp_ns.saturating_sub(last_ns);
            let is_short = (1..STEP_MAX_NS).contains(&dt_ns);
            is_short.then(|| (dt_ns as f64 * 1e-9, last.between(&pose)))
        });
        self.last = now;
        let before_m_s = self.speed_m_s.take();
        self.change_m_s2 = Vector2::zeros();
        if let Some((dt_s, motion)) = step {
            let speed_m_s = carried_m_s.map_or_else(|| motion.log().xy() / dt_s, Vector2::from);
            self.speed_m_s = Some(speed_m_s);
            if let Some(before_m_s) = before_m_s {
                self.change_m_s2 = (speed_m_s - before_m_s) / dt_s;
            }
        }
    }

    /// What an accelerometer shows of it while the robot turns at a yaw rate, m/s^2.
    pub fn at(&self, yaw_rate_rad_s: f64) -> Vector3<f64> {
        let speed_m_s = self.speed_m_s.unwrap_or_default();
        Vector3::new(
            self.change_m_s2.x - yaw_rate_rad_s * speed_m_s.y,
            self.change_m_s2.y + yaw_rate_rad_s * speed_m_s.x,
            0.0,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary;

    const STEP_NS: i64 = 250_000_000;

    /// A bend of 20 m radius that is driven faster and faster: the accelerations are the derivative
    /// of the speed, and v^2 / r towards the middle.
    #[test]
    fn a_bend_has_its_two_accelerations() {
        let (radius_m, rise_m_s2) = (20.0, 0.5);
        for is_carried in [false, true] {
            let mut own = OwnAcceleration::default();
            for step in 0..16_u8 {
                let t_s = f64::from(step) * 0.25;
                let way_m = 6.0 * t_s + 0.5 * rise_m_s2 * t_s * t_s;
                let (s, c) = elementary::sin_cos(way_m / radius_m);
                let fix = RadarFix {
                    pose: Pose2::new(radius_m * s, radius_m * (1.0 - c), way_m / radius_m),
                    sigma_m: [0.02; 2],
                };
                let carried = is_carried.then_some([6.0 + rise_m_s2 * t_s, 0.0]);
                own.observe_scan(i64::from(step) * STEP_NS, Some(&fix), carried);
            }
            // The radar's is that of the middle between two scans.
            let lag_s = if is_carried { 0.0 } else { 0.125 };
            let speed_m_s = 6.0 + rise_m_s2 * (15.0 * 0.25 - lag_s);
            let shown = own.at(speed_m_s / radius_m);
            let expected = Vector3::new(rise_m_s2, speed_m_s * speed_m_s / radius_m, 0.0);
            assert!((shown - expected).norm() < 1e-3, "{shown} {expected}");
            own.observe_scan(16 * STEP_NS, None, None);
            assert_eq!(own.at(1.0), Vector3::zeros());
        }
    }
}
