//! The final pose of every scan: odometry's own motion, hung between the keyframes as the graph has them.

use randt_evaluation::Trajectory;
use randt_geometry::Pose2;
use randt_mapper::Mapper;
use randt_messages::OdometryState;

/// A keyframe: where odometry saw it live, and where the map has it.
struct Knot {
    stamp_ns: i64,
    odom_frame_id: u64,
    part: u64,
    live: Pose2,
    last: Pose2,
}

impl Knot {
    /// A live pose of this knot's frame, carried over into the map.
    fn carry(&self, live: &Pose2) -> Pose2 {
        self.last.compose(&self.live.between(live))
    }
}

/// All scans in the map. The frame of a pose is the first `odom_frame_id` of its part of the map.
pub fn final_poses(states: &[OdometryState], mapper: &Mapper) -> Trajectory {
    let knots = knots(states, mapper);
    let mut trajectory = Trajectory::stamped();
    for state in states {
        let stamp_ns = state.header.stamp_ns;
        let live = Pose2::from_array(state.pose);
        let same = |knot: &&Knot| knot.odom_frame_id == state.odom_frame_id;
        let after = knots.partition_point(|knot| {
            (knot.odom_frame_id, knot.stamp_ns) <= (state.odom_frame_id, stamp_ns)
        });
        let before = after.checked_sub(1).and_then(|i| knots.get(i)).filter(same);
        let next = knots.get(after).filter(same);
        let (part, pose) = match (before, next) {
            (Some(a), Some(b)) => {
                let fraction =
                    (stamp_ns - a.stamp_ns) as f64 / (b.stamp_ns - a.stamp_ns).max(1) as f64;
                (
                    a.part,
                    a.carry(&live).interpolate(&b.carry(&live), fraction),
                )
            }
            (Some(only), None) | (None, Some(only)) => (only.part, only.carry(&live)),
            // A frame without any keyframe stays by itself.
            (None, None) => (state.odom_frame_id, live),
        };
        trajectory.push(stamp_ns, part, pose);
    }
    trajectory
}

/// The keyframes that have a live pose, in order of their frames and stamps.
fn knots(states: &[OdometryState], mapper: &Mapper) -> Vec<Knot> {
    let mut states = states.iter().peekable();
    let mut knots = Vec::new();
    for (index, (place, last)) in mapper.places().iter().zip(mapper.poses()).enumerate() {
        let first = mapper.places().get(mapper.part_of(index));
        let wanted = (place.odom_frame_id, place.stamp_ns);
        let key = |state: &OdometryState| (state.odom_frame_id, state.header.stamp_ns);
        while states.next_if(|state| key(state) < wanted).is_some() {}
        if let Some(state) = states.peek().filter(|state| key(state) == wanted) {
            knots.push(Knot {
                stamp_ns: place.stamp_ns,
                odom_frame_id: place.odom_frame_id,
                part: first.map_or(place.odom_frame_id, |first| first.odom_frame_id),
                live: Pose2::from_array(state.pose),
                last: *last,
            });
        }
    }
    knots
}
