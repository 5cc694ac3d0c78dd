//! The final pose of every scan: odometry's retired poses, carried into the map between the
//! keyframes as the graph has them.

use randt_evaluation::Trajectory;
use randt_geometry::Pose2;
use randt_mapper::{KeyframeIdx, Mapper};
use randt_messages::OdometryState;
use std::collections::BTreeMap;

/// A scan of one odometry frame: the frame's number, then the stamp.
pub type Key = (u64, i64);

/// A keyframe, with its poses in `odom` and in the map.
pub struct Knot {
    /// Its scan.
    pub key: Key,
    /// Names its component of the map; in a mapper: the component's first `odom_frame_id`.
    pub component: u64,
    /// Final, in `odom`.
    pub odom: Pose2,
    /// In the map.
    pub map: Pose2,
}

impl Knot {
    /// A pose of this knot's odometry frame, carried over into the map.
    fn carry(&self, odom: &Pose2) -> Pose2 {
        self.map.compose(&self.odom.between(odom))
    }
}

/// All scans in the map. The frame of a pose is the first `odom_frame_id` of its component of the
/// map.
pub fn final_poses(states: &[OdometryState], mapper: &Mapper) -> Trajectory {
    carry_into_map(states, &knots(mapper))
}

/// The pose of each scan in `odom` as it left the window; the last scans of a frame never did, and
/// have their live pose.
pub fn odometry_poses(states: &[OdometryState]) -> impl Iterator<Item = Pose2> {
    let mut retired: BTreeMap<Key, [f64; 3]> = BTreeMap::new();
    for state in states.iter().filter(|state| state.retired_stamp_ns != 0) {
        let key = (state.odom_frame_id, state.retired_stamp_ns);
        retired.insert(key, state.retired_pose);
    }
    states.iter().map(move |state| {
        let key = (state.odom_frame_id, state.header.stamp_ns);
        Pose2::from_array(retired.get(&key).copied().unwrap_or(state.pose))
    })
}

/// All scans between knots, that are in the order of their keys. The frame of a pose is the
/// component of its knots; where its odometry frame has none, that frame.
pub fn carry_into_map(states: &[OdometryState], knots: &[Knot]) -> Trajectory {
    let mut trajectory = Trajectory::stamped();
    for (state, odom) in states.iter().zip(odometry_poses(states)) {
        let key = (state.odom_frame_id, state.header.stamp_ns);
        let same = |knot: &&Knot| knot.key.0 == key.0;
        let after = knots.partition_point(|knot| knot.key <= key);
        let before = after.checked_sub(1).and_then(|i| knots.get(i)).filter(same);
        let next = knots.get(after).filter(same);
        let (component, pose) = match (before, next) {
            (Some(a), Some(b)) => {
                let fraction = (key.1 - a.key.1) as f64 / (b.key.1 - a.key.1).max(1) as f64;
                let pose = a.carry(&odom).interpolate(&b.carry(&odom), fraction);
                (a.component, pose)
            }
            (Some(only), None) | (None, Some(only)) => (only.component, only.carry(&odom)),
            // A frame without any keyframe stays by itself.
            (None, None) => (key.0, odom),
        };
        trajectory.push(key.1, component, pose);
    }
    trajectory
}

/// The keyframes, in order of their frames and stamps.
fn knots(mapper: &Mapper) -> Vec<Knot> {
    let keyframes = mapper.keyframes();
    let knot = |(index, map): (usize, &Pose2)| {
        let keyframe = keyframes.get(index)?;
        let first = mapper.component_of(KeyframeIdx(index)).first_keyframe();
        let first = keyframes.get(first.0)?;
        Some(Knot {
            key: (keyframe.odom_frame_id, keyframe.stamp_ns),
            component: first.odom_frame_id,
            odom: keyframe.odom_from_base,
            map: *map,
        })
    };
    let poses = mapper.poses().iter().enumerate();
    poses.filter_map(knot).collect()
}
