//! Going on without the whole state: a new frame that begins at the last pose, and numbers without
//! a gap.

use super::Odometry;
use crate::odometry_frame::OdometryFrame;
use nalgebra::Vector3;
use randt_config::Config;
use randt_geometry::{Pose2, Quaternion};
use randt_messages::PoseRecord;

impl Odometry {
    /// The last pose and the numbers so far, for [`Self::resume`].
    pub fn pose_record(&self) -> PoseRecord {
        PoseRecord {
            odom_frame_id: self.frame.id,
            next_state: self.publisher.next_id(),
            next_keyframe: self.keyframes.next_id(),
            next_submap: self.submaps.next_id(),
            ..*self.publisher.record()
        }
    }

    /// Begins a new frame at the kept pose: the way since then is not known, so the frame is
    /// another one. Gyro bias and heading of the attitude are kept; the numbers of states,
    /// keyframes and submaps go on.
    pub fn resume(config: &Config, use_imu: bool, record: &PoseRecord) -> Self {
        let mut odometry = Self::new(config, use_imu);
        let [w, x, y, z] = record.attitude;
        if let Some(gyro) = &mut odometry.gyro {
            let bias = finite(record.gyro_bias_rad_s).unwrap_or_default();
            gyro.start_from(Vector3::from(bias), Quaternion::new(w, x, y, z));
        }
        let odom_from_first = finite(record.pose)
            .map(Pose2::from_array)
            .unwrap_or_default();
        odometry.frame = OdometryFrame::after(number(record.odom_frame_id), odom_from_first);
        odometry
            .publisher
            .continue_from(number(record.next_state), record);
        odometry
            .keyframes
            .continue_from(number(record.next_keyframe));
        odometry.submaps.continue_from(number(record.next_submap));
        odometry
    }

    /// For a start without any record where the mapper has keyframes already: the number after its
    /// last one, and the frame of that one, which ours comes after. Without effect once a keyframe
    /// was made; numbers never go back.
    pub fn continue_after(&mut self, next_keyframe: u64, odom_frame_id: u64) {
        if self.keyframes.has_made() {
            return;
        }
        self.frame.id = self.frame.id.max(number(odom_frame_id) + 1);
        self.keyframes
            .continue_from(self.keyframes.next_id().max(number(next_keyframe)));
        self.submaps.renumber_root(self.keyframes.next_id());
    }
}

/// A number that leaves room for those after it.
fn number(number: u64) -> u64 {
    number.min(u64::MAX / 2)
}

/// The values, where they are numbers.
fn finite<const N: usize>(values: [f64; N]) -> Option<[f64; N]> {
    values.iter().all(|v| v.is_finite()).then_some(values)
}
