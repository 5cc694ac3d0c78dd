//! Whether a pose can be believed.

use crate::window::Solution;
use nalgebra::{Matrix2, SymmetricEigen};
use randt_config::Config;
use randt_messages::Trust;
use randt_saved::saved;

/// Mean robust weight below which most of a scan finds nothing alike in the map.
const FIT_MIN: f64 = 0.1;
/// Scans in a row without support before the pose is given up.
const LOST_AFTER: u32 = 5;
/// Cells that a scan needs to fix a pose at all.
const CELLS_MIN: usize = 5;

/// Watches the solutions.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrustJudge {
    unsupported: u32,
}

saved!(TrustJudge { unsupported } sound has_room);

/// Eigenvalues of the position information that the scan gives by itself, smaller first, 1/m^2: yaw is free.
pub fn position_information(solution: &Solution) -> [f64; 2] {
    let h = &solution.scan_information;
    let yaw = h.m33.max(f64::MIN_POSITIVE);
    let reduced = Matrix2::new(
        h.m11 - h.m13 * h.m31 / yaw,
        h.m12 - h.m13 * h.m32 / yaw,
        h.m21 - h.m23 * h.m31 / yaw,
        h.m22 - h.m23 * h.m32 / yaw,
    );
    let values = SymmetricEigen::new(reduced).eigenvalues;
    [
        values.x.min(values.y).max(0.0),
        values.x.max(values.y).max(0.0),
    ]
}

impl TrustJudge {
    /// Whether it can go on counting.
    fn has_room(&self) -> bool {
        self.unsupported <= u32::MAX / 2
    }

    /// Judges one scan.
    pub fn judge(
        &mut self,
        solution: &Solution,
        cells: usize,
        speed_m_s: f64,
        config: &Config,
    ) -> Trust {
        let odometry = &config.odometry;
        let [weak, strong] = position_information(solution);
        let supported = cells >= CELLS_MIN && solution.fit >= FIT_MIN;
        self.unsupported = if supported { 0 } else { self.unsupported + 1 };
        if self.unsupported >= LOST_AFTER || speed_m_s > odometry.speed_max_m_s {
            return Trust::Lost;
        }
        if !supported || weak < odometry.degenerate_ratio * strong {
            return Trust::Degraded;
        }
        Trust::Good
    }
}
