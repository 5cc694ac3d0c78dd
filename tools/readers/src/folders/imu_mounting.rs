//! How a data set's IMU hangs on the robot.

use super::layout::Layout;
use randt_geometry::Quaternion;
use randt_messages::ImuSample;
use std::f64::consts::FRAC_1_SQRT_2;
use std::ffi::OsStr;

/// A specific force along z beyond this, m/s^2, on average, shows which way an IMU hangs.
const SHOWN_M_S2: f64 = 5.0;

/// By the data set's own description where gravity does not contradict it, else by gravity alone;
/// `None` where it stands as the robot does, or there is none.
pub(super) fn imu_mounting(layout: &Layout, samples: &[ImuSample]) -> Option<Quaternion> {
    let count = samples.len().max(1) as f64;
    let sum: f64 = samples.iter().map(|s| s.acceleration_m_s2[2]).sum();
    let up_m_s2 = sum / count;
    let is_upside_down = up_m_s2 < -SHOWN_M_S2;
    let file = layout.imu.as_ref().and_then(|path| path.file_name());
    match file.and_then(OsStr::to_str) {
        // Boreas' Applanix: x to the right, y forward, z up.
        Some("imu.csv") if !is_upside_down && !samples.is_empty() => {
            Some(Quaternion::new(FRAC_1_SQRT_2, 0.0, 0.0, -FRAC_1_SQRT_2))
        }
        // The same IMU in its own axes: x backward, y to the left, z down.
        Some("imu_raw.csv") if is_upside_down => Some(Quaternion::new(0.0, 0.0, 1.0, 0.0)),
        _ => is_upside_down.then(|| Quaternion::new(0.0, 1.0, 0.0, 0.0)),
    }
}
