//! TUM rows: stamp x y z qx qy qz qw, with a comment where a frame begins.

use crate::Trajectory;
use crate::read::{FRAME_MARK, stamp_text};
use randt_geometry::elementary::sin_cos;
use std::fmt::Write;

impl Trajectory {
    /// The trajectory as TUM rows: micrometres, nanoradians; z, roll and pitch are 0.
    ///
    /// Every frame begins with a comment `# odom_frame_id N`, so that two of them are never
    /// spliced.
    pub fn to_tum(&self) -> String {
        let mut text = String::new();
        let mut frame = None;
        for pose in self.poses() {
            if frame != Some(pose.frame) {
                frame = Some(pose.frame);
                // Writing to a String cannot fail.
                let _ = writeln!(text, "# {FRAME_MARK} {}", pose.frame);
            }
            let planar = pose.transform.pose();
            let (z, w) = sin_cos(0.5 * planar.yaw_rad);
            let _ = writeln!(
                text,
                "{} {:.6} {:.6} 0 0 0 {z:.9} {w:.9}",
                stamp_text(pose.stamp_ns),
                planar.x_m,
                planar.y_m
            );
        }
        text
    }
}
