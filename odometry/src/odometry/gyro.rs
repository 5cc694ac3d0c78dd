//! The gyro against the radar.

use super::Odometry;
use crate::{
    gyro_check::{ScanEvidence, Verdict},
    sliding_window::Solution,
    tracking_monitor::fit_min,
};

/// Cells from which a scan knows its heading better than a gyro that may be wrong: a room shows 25
/// and more, the few of an open floor meet by chance.
const COMPARED_CELLS: usize = 15;

impl Odometry {
    /// Compares what the gyro has measured with what the newest scan shows; where the gyro is
    /// wrong, estimates the window's states without it.
    pub(super) fn check_gyro(&mut self, solution: Option<Solution>) -> Option<Solution> {
        let (Some(gyro), Some(solution)) = (&self.gyro, solution) else {
            return solution;
        };
        if !self.config.odometry.deskew {
            // A scan that is not de-skewed turns half a sweep late by itself.
            return Some(solution);
        }
        let Some(scan) = self.window.newest() else {
            return Some(solution);
        };
        let stamp_ns = scan.message.head.sweep.end_ns;
        let is_clear =
            scan.cells.len() >= COMPARED_CELLS && !scan.message.head.sweep.is_contested();
        let fit_min = fit_min(&self.config);
        // A wrong gyro lets the scan show another world, too.
        let is_poor = solution.fit < fit_min || self.overlap.is_strange();
        let rates = gyro.rates();
        let was_refused = self.gyro_check.is_refused();
        let evidence = ScanEvidence {
            is_clear,
            is_poor,
            yaw_variance: solution.covariance[(2, 2)],
            correspondence_information: scan.correspondence_information(&self.config),
        };
        let verdict = self.gyro_check.observe(scan, &evidence, rates);
        if was_refused
            && !self.gyro_check.is_refused()
            && let Some(gyro) = &mut self.gyro
        {
            // The speed was carried by rates that were wrong.
            gyro.restart_inertial_speed();
        }
        match verdict {
            Verdict::Keep => return Some(solution),
            Verdict::Late(late_ns) => {
                if let Some(gyro) = (self.gyro.as_mut()).filter(|gyro| gyro.can_be_later(late_ns)) {
                    gyro.add_late(late_ns);
                    self.gyro_check.set_late(gyro.late_ns());
                }
                return Some(solution);
            }
            Verdict::Try | Verdict::Refuse => {}
        }
        let submap = self.submaps.active();
        let without = self
            .window
            .solve_without_gyro(submap, fit_min, &self.config);
        if without.is_some() || verdict == Verdict::Refuse {
            self.gyro_check.refuse(stamp_ns);
            self.clutter.restart();
            self.overlap.restart();
        } else {
            self.gyro_check.keep(stamp_ns);
        }
        Some(without.unwrap_or(solution))
    }

    /// The gyro's samples before the window's oldest sweep are not needed any more.
    pub(super) fn forget_gyro_before_window(&mut self) {
        if let (Some(gyro), Some(oldest)) = (&mut self.gyro, self.window.oldest()) {
            gyro.forget_before(oldest.message.head.sweep.begin_ns);
        }
    }
}
