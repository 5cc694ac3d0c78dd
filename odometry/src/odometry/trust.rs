//! How far the newest pose can be believed.

use super::Odometry;
use crate::{sliding_window::Solution, tracking_status::TrackingStatus};
use randt_messages::{Trust, TrustReason};

impl Odometry {
    /// Judges how far the newest pose can be believed.
    pub(super) fn judge(&mut self, solution: Option<&Solution>) {
        let Some(scan) = self.window.newest() else {
            return;
        };
        let mut status = match solution {
            Some(solution) => {
                let gyro = self.gyro.as_ref();
                let disagrees = !self.gyro_check.is_refused()
                    && gyro.is_some_and(|gyro| gyro.inertial_speed().disagrees());
                let stamp_ns = scan.message.head.sweep.end_ns;
                let is_undecided = self.gyro_check.is_undecided(stamp_ns);
                let doubts = TrustReason::Imu.bit_if(disagrees || is_undecided)
                    | TrustReason::Moving.bit_if(self.clutter.lasts())
                    | TrustReason::Fit.bit_if(self.overlap.is_strange());
                self.tracking.judge(solution, scan, doubts, &self.config)
            }
            None => TrackingStatus::without_solution(scan.cells.len()),
        };
        if self.frame.is_waiting() || self.overlap.has_jumped() {
            status.trust = Trust::Lost as u32;
        }
        let variance_m2 = solution.map(Solution::position_variance_m2);
        self.window.set_status(status, variance_m2);
        let trust = status.trust();
        if trust != Trust::Good && !self.window.is_first_of_frame() {
            self.counters.scans_unsupported += 1;
        }
        self.frame.is_lost = trust == Trust::Lost && self.frame.has_begun;
    }
}
