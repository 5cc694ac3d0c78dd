//! Poses over time.

use crate::Transform;
use randt_geometry::{
    Pose2,
    elementary::{PI, atan2},
};

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

/// What poses have besides x, y and yaw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftOut {
    /// Lowest and highest, m; `None` before the first pose.
    heights_m: Option<[f64; 2]>,
    /// Least component of the z axis along the vertical.
    least_up: Option<f64>,
}

/// Heights and tilts below these are a plane's, as printed: m, and cosine of half a degree.
const PLANE_HEIGHT_M: f64 = 0.01;
const PLANE_UP: f64 = 0.99996;

impl LeftOut {
    /// From the lowest to the highest pose, m.
    pub fn height_m(&self) -> f64 {
        self.heights_m.map_or(0.0, |[low, high]| high - low)
    }

    /// The largest tilt, deg.
    pub fn tilt_deg(&self) -> f64 {
        let up = self.least_up.unwrap_or(1.0).clamp(-1.0, 1.0);
        atan2((1.0 - up * up).sqrt(), up) * 180.0 / PI
    }

    /// Whether that is more than rounding.
    pub fn is_flattened(&self) -> bool {
        self.height_m() > PLANE_HEIGHT_M || self.least_up.is_some_and(|up| up < PLANE_UP)
    }
}

/// Poses in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<TrajectoryPose>,
    stamped: bool,
    left_out: LeftOut,
}

impl Trajectory {
    /// A trajectory whose poses have stamps, in rising order.
    pub fn stamped() -> Self {
        Self {
            stamped: true,
            ..Self::default()
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

    /// Keeps a pose's height and how far its z axis points up.
    pub(crate) fn leave_out(&mut self, [height_m, up]: [f64; 2]) {
        let [low, high] = self.left_out.heights_m.unwrap_or([height_m; 2]);
        self.left_out.heights_m = Some([low.min(height_m), high.max(height_m)]);
        let least = self.left_out.least_up.unwrap_or(up);
        self.left_out.least_up = Some(least.min(up));
    }

    /// What the poses that were read have besides x, y and yaw.
    pub fn left_out(&self) -> LeftOut {
        self.left_out
    }

    /// Brings the poses in order of time; those without stamps stay.
    pub(crate) fn sort(&mut self) {
        self.poses.sort_by_key(|pose| pose.stamp_ns);
    }

    /// The poses.
    pub fn poses(&self) -> &[TrajectoryPose] {
        &self.poses
    }

    /// The poses of one frame.
    pub fn of_frame(&self, frame: u64) -> Self {
        let mut poses = self.poses.clone();
        poses.retain(|pose| pose.frame == frame);
        Self { poses, ..*self }
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
