//! A keyframe as the mapper keeps it.

mod observation;
mod store;

pub use observation::{LazyObservation, Observation};
pub(crate) use store::{KeyframeStore, SavedKeyframes};

use crate::pose_graph::position_sigma_m;
use nalgebra::Matrix3;
use randt_geometry::Pose2;
use randt_messages::{Keyframe, KeyframeHead, Localizability, MessageRef};

/// A step counts as no less certain than this, m: what is not finite is unknown, and sums over a
/// drive keep their millimetres.
const STEP_SIGMA_MAX_M: f64 = 100.0;

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
    /// Rate of turn, rad/s.
    pub turn_rad_s: f64,
    /// Path driven since the start, m; frames of odometry count on.
    pub path_m: f64,
    /// Variance of the position that odometry's steps have added since the start, each along its
    /// least certain direction, m^2; frames of odometry count on.
    pub drift_m2: f64,
    /// Whether the scan saw every direction by itself, as far as that was judged.
    pub sees_all: bool,
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
        let step_covariance = Matrix3::from_row_slice(&head.covariance);
        let is_known = step_covariance.iter().all(|value| value.is_finite());
        let step_sigma_m = match is_known {
            true => position_sigma_m(&step_covariance).min(STEP_SIGMA_MAX_M),
            false => STEP_SIGMA_MAX_M,
        };
        Self {
            keyframe_id: head.id,
            stamp_ns: head.header.stamp_ns,
            odom_frame_id: head.odom_frame_id,
            submap_root: head.submap_root,
            odom_from_base,
            step_covariance,
            speed_m_s: (head.twist[0] * head.twist[0] + head.twist[1] * head.twist[1]).sqrt(),
            turn_rad_s: head.twist[2],
            path_m: before.map_or(0.0, |before| before.path_m) + step_m,
            drift_m2: before.map_or(0.0, |before| before.drift_m2) + step_sigma_m * step_sigma_m,
            sees_all: matches!(
                Localizability::from_code(head.localizability),
                Localizability::Full | Localizability::Unknown
            ),
            observation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::Message;

    #[test]
    fn drift_adds_up_along_the_least_certain_direction_of_each_step() {
        let mut before: Option<MapKeyframe> = None;
        let mut push = |variances: [f64; 2], localizability: Localizability| {
            let mut message = Message::<Keyframe>::default();
            (message.head.covariance[0], message.head.covariance[4]) = variances.into();
            message.head.localizability = localizability as u32;
            let keyframe = MapKeyframe::new(message.as_ref(), before.as_ref());
            let found = (keyframe.drift_m2, keyframe.sees_all);
            before = Some(keyframe);
            found
        };
        assert_eq!(push([0.0, 0.0], Localizability::Unknown), (0.0, true));
        let (drift_m2, sees_all) = push([0.01, 0.04], Localizability::Partial);
        assert!((drift_m2 - 0.04).abs() < 1e-12 && !sees_all);
        let (drift_m2, sees_all) = push([0.02, 0.01], Localizability::Full);
        assert!((drift_m2 - 0.06).abs() < 1e-12 && sees_all);
        let (drift_m2, sees_all) = push([f64::NAN, 1.0], Localizability::None);
        assert!(drift_m2 >= 1e4 && drift_m2.is_finite() && !sees_all);
    }
}
