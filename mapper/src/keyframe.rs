//! A keyframe as the mapper keeps it.

mod observation;
mod store;

pub use observation::{LazyObservation, Observation};
pub(crate) use store::{KeyframeStore, SavedKeyframes};

use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframeHead, MessageRef};

/// A keyframe of the map.
#[derive(Clone, Debug)]
pub struct MapKeyframe {
    /// Number that odometry gave it.
    pub keyframe_id: u64,
    /// End of the sweep.
    pub stamp_ns: i64,
    /// Frame of `odom_from_base`.
    pub odom_frame_id: u64,
    /// Number of the keyframe at the root of the submap that odometry registered it to.
    pub submap_root: u64,
    /// Pose of `base_link` in that odometry frame, final.
    pub odom_from_base: Pose2,
    /// Covariance (x, y, yaw) relative to the keyframe before, in this one's frame; m^2, m rad,
    /// rad^2.
    pub step_covariance: Matrix3<f64>,
    /// Speed over ground, m/s.
    pub speed_m_s: f64,
    /// Path driven since the start, m; frames of odometry count on.
    pub path_m: f64,
    /// What was seen from there.
    pub observation: LazyObservation,
}

impl MapKeyframe {
    /// The keyframe of a message; `before` is the last one, in whichever frame.
    pub fn new(keyframe: MessageRef<'_, Keyframe>, before: Option<&Self>) -> Self {
        let observation = Observation::from_message(keyframe).into();
        Self::from_head(keyframe.head, observation, before)
    }

    /// The keyframe of a message's head and what was seen.
    pub(crate) fn from_head(
        head: &KeyframeHead,
        observation: LazyObservation,
        before: Option<&Self>,
    ) -> Self {
        let odom_from_base = Pose2::from_array(head.pose);
        let same_frame = before.filter(|before| before.odom_frame_id == head.odom_frame_id);
        let step = same_frame.map(|before| before.odom_from_base.between(&odom_from_base));
        let step_m = step.map_or(0.0, |step| step.translation().norm());
        Self {
            keyframe_id: head.id,
            stamp_ns: head.header.stamp_ns,
            odom_frame_id: head.odom_frame_id,
            submap_root: head.submap_root,
            odom_from_base,
            step_covariance: Matrix3::from_row_slice(&head.covariance),
            speed_m_s: (head.twist[0] * head.twist[0] + head.twist[1] * head.twist[1]).sqrt(),
            path_m: before.map_or(0.0, |before| before.path_m) + step_m,
            observation,
        }
    }
}
