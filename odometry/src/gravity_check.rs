//! Whether the accelerometer shows gravity, and which way is up.

use nalgebra::Vector3;
use randt_persist::persist;

/// Standard gravity, m/s^2.
const GRAVITY_M_S2: f64 = 9.806_65;
/// Memory of the mean, s: pushes and brakes are shorter.
const MEMORY_S: f64 = 1.0;
/// Share of gravity below which it is not there: what comes without it, or in g, has a tenth.
const MISSING_MAX: f64 = 0.5;
/// Share along the robot's vertical from which it hangs upside down: no slope does that.
const DOWN_MIN: f64 = 0.5;

/// Follows the mean of the specific force in the robot's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct GravityCheck {
    mean_m_s2: Vector3<f64>,
    last_ns: Option<i64>,
    /// Samples without gravity, and what the last one showed in its place, m/s^2.
    pub missing: u64,
    pub shown_m_s2: f64,
}

persist!(GravityCheck {
    mean_m_s2,
    last_ns,
    missing,
    shown_m_s2,
} sound has_room);

impl GravityCheck {
    fn has_room(&self) -> bool {
        self.missing <= u64::MAX / 2
    }

    /// Takes a sample; gives whether it shows gravity.
    pub fn push(&mut self, stamp_ns: i64, force_m_s2: Vector3<f64>) -> bool {
        let dt_s = self.last_ns.map_or(f64::INFINITY, |last_ns| {
            stamp_ns.saturating_sub(last_ns).max(0) as f64 * 1e-9
        });
        let share = (dt_s / MEMORY_S).min(1.0);
        self.mean_m_s2 += (force_m_s2 - self.mean_m_s2) * share;
        self.last_ns = Some(stamp_ns);
        let length_m_s2 = self.mean_m_s2.norm();
        let is_missing = length_m_s2 < MISSING_MAX * GRAVITY_M_S2;
        if is_missing {
            self.missing += 1;
            self.shown_m_s2 = length_m_s2;
        }
        !is_missing
    }

    /// Whether the robot or its IMU is upside down.
    pub fn is_upside_down(&self) -> bool {
        self.mean_m_s2.z < -DOWN_MIN * GRAVITY_M_S2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pushed(force_m_s2: [f64; 3]) -> GravityCheck {
        let mut gravity = GravityCheck::default();
        for number in 0..500 {
            gravity.push(number * 4_000_000, force_m_s2.into());
        }
        gravity
    }

    #[test]
    fn gravity_is_there_is_not_there_or_points_down() {
        let upright = pushed([1.0, -2.0, 9.5]);
        assert_eq!((upright.missing, upright.is_upside_down()), (0, false));
        assert!(pushed([0.5, 0.0, -9.8]).is_upside_down());
        let missing = pushed([0.0, 0.0, 0.6]);
        assert!(missing.missing == 500 && (missing.shown_m_s2 - 0.6).abs() < 1e-12);
        // One push is none.
        let mut pushed = pushed([0.0, 0.0, 9.8]);
        pushed.push(2_004_000_000, [0.0, 0.0, -30.0].into());
        assert!(!pushed.is_upside_down() && pushed.missing == 0);
    }
}
