//! A place: a keyframe as the mapper keeps it.

use crate::{LazySight, Sight};
use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframeHead, MessageRef};

/// A keyframe.
#[derive(Clone, Debug)]
pub struct Place {
    /// Number that odometry gave it.
    pub keyframe_id: u64,
    /// End of the sweep.
    pub stamp_ns: i64,
    /// Frame of `odom`.
    pub odom_frame_id: u64,
    /// Keyframe at the root of the submap that odometry registered it to.
    pub submap_root: u64,
    /// Pose in that frame, final.
    pub odom: Pose2,
    /// Covariance relative to the place before, in this one's frame.
    pub step_covariance: Matrix3<f64>,
    /// Speed over ground, m/s.
    pub speed_m_s: f64,
    /// Path driven since the start, m; frames of odometry count on.
    pub path_m: f64,
    /// What was seen from there.
    pub sight: LazySight,
}

impl Place {
    /// The place of a message; `before` is the last one, in whatever frame.
    pub fn new(keyframe: MessageRef<'_, Keyframe>, before: Option<&Self>) -> Self {
        Self::of(keyframe.head, Sight::of(keyframe).into(), before)
    }

    /// The place of a keyframe's head and what was seen.
    pub(crate) fn of(head: &KeyframeHead, sight: LazySight, before: Option<&Self>) -> Self {
        let odom = Pose2::from_array(head.pose);
        let step_m = before
            .filter(|before| before.odom_frame_id == head.odom_frame_id)
            .map_or(0.0, |before| {
                before.odom.between(&odom).translation().norm()
            });
        Self {
            keyframe_id: head.id,
            stamp_ns: head.header.stamp_ns,
            odom_frame_id: head.odom_frame_id,
            submap_root: head.submap_root,
            odom,
            step_covariance: Matrix3::from_row_slice(&head.covariance),
            speed_m_s: (head.twist[0] * head.twist[0] + head.twist[1] * head.twist[1]).sqrt(),
            path_m: before.map_or(0.0, |before| before.path_m) + step_m,
            sight,
        }
    }
}
