//! A frame that waits for its first scan.

use super::Odometry;
use crate::localizability::CELLS_MIN;
use randt_geometry::Pose2;
use randt_messages::Localizability;

impl Odometry {
    /// As long as the frame has not begun, a scan of too few cells to be set against another one
    /// ends what was tried: the next scan is the first. Only the heading goes on, by the gyro.
    pub(super) fn begin_frame_or_wait(&mut self) {
        let Some(newest) = self.window.newest() else {
            return;
        };
        let seen = newest.localizability.seen;
        self.frame.has_begun |= !self.window.holds_first_scan()
            || !self.window.is_first_of_frame() && seen == Localizability::Full;
        if !self.frame.has_begun && newest.cells.len() < CELLS_MIN {
            let yaw_rad = newest.state.odom_from_base.yaw_rad;
            self.frame.odom_from_first = at_heading(&self.frame.odom_from_first, yaw_rad);
            self.frame.waits_since_ns = Some(newest.message.head.sweep.end_ns);
            self.frame.has_waited = true;
        }
    }

    /// The heading at which a frame that waits for its first scan is at an instant.
    pub(super) fn turn_waiting_frame(&mut self, end_ns: i64) {
        let gyro = self.gyro.as_ref().filter(|_| !self.gyro_check.is_refused());
        let Some((since_ns, gyro)) = self.frame.waits_since_ns.take().zip(gyro) else {
            return;
        };
        if let Some(turn) = gyro.turn_between(since_ns, end_ns) {
            let bias_rad = gyro.bias_rad_s().z * (end_ns - since_ns) as f64 * 1e-9;
            let pose = self.frame.odom_from_first;
            let yaw_rad = pose.yaw_rad + turn.angle_rad - bias_rad;
            self.frame.odom_from_first = at_heading(&pose, yaw_rad);
            self.submaps.move_root(self.frame.odom_from_first);
        }
    }
}

/// The same position at another heading.
fn at_heading(pose: &Pose2, yaw_rad: f64) -> Pose2 {
    Pose2::new(pose.x_m, pose.y_m, yaw_rad)
}
