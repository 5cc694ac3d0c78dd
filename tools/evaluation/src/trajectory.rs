//! Poses over time.

use crate::Transform;
use randt_geometry::Pose2;

/// One pose of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPose {
    /// The instant of the pose; 0 in a trajectory without stamps.
    pub stamp_ns: i64,
    /// `odom_frame_id`: poses of two frames cannot be compared.
    pub frame: u64,
    /// `base_link` in the frame.
    pub transform: Transform,
}

impl TrajectoryPose {
    /// `base_link`'s origin in the frame.
    pub fn position_m(&self) -> [f64; 2] {
        [self.transform.x_m, self.transform.y_m]
    }
}

/// Poses in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<TrajectoryPose>,
    stamped: bool,
}

impl Trajectory {
    /// A trajectory whose poses have stamps, in rising order.
    pub fn stamped() -> Self {
        Self {
            poses: Vec::new(),
            stamped: true,
        }
    }

    /// A trajectory of rows without stamps.
    pub fn unstamped() -> Self {
        Self::default()
    }

    /// Adds a pose at the end. `stamp_ns` should be after the last one's, or the pose is never
    /// found.
    pub fn push(&mut self, stamp_ns: i64, frame: u64, pose: Pose2) {
        self.push_pose(TrajectoryPose {
            stamp_ns,
            frame,
            transform: pose.into(),
        });
    }

    pub(crate) fn push_pose(&mut self, pose: TrajectoryPose) {
        self.poses.push(pose);
    }

    /// The poses.
    pub fn poses(&self) -> &[TrajectoryPose] {
        &self.poses
    }

    /// Whether the poses have stamps.
    pub fn is_stamped(&self) -> bool {
        self.stamped
    }

    /// Path from the first pose to each, m. A change of frame adds nothing.
    pub(crate) fn path_m(&self) -> Vec<f64> {
        let mut path_m = 0.0;
        let mut before: Option<&TrajectoryPose> = None;
        let poses = self.poses.iter();
        let path_m = poses.map(|pose| {
            if let Some(before) = before.filter(|before| before.frame == pose.frame) {
                path_m += pose.transform.distance_to_m(&before.transform);
            }
            before = Some(pose);
            path_m
        });
        path_m.collect()
    }
}
