//! Trajectories in the TUM format.

use crate::output::write_whole;
use crate::units::count;
use randt_evaluation::Trajectory;
use randt_geometry::Pose2;
use randt_log::LogReader;
use randt_messages::{Correction, MapperCorrection, OdometryStateTopic, TruthPoseTopic};
use std::io::{Read, Seek};
use std::path::Path;

/// Writes `odometry.tum`, the live pose in `odom`; `map.tum`, the same in `map` as it was known
/// then; and `truth.tum` where the log has the truth.
pub fn export<R: Read + Seek>(reader: &mut LogReader<R>, folder: &Path) -> anyhow::Result<String> {
    let mut odometry = Trajectory::stamped();
    let mut map = Trajectory::stamped();
    let mut truth = Trajectory::stamped();
    let mut correction: Option<Correction> = None;
    let mut last = None;
    while let Some(entry) = reader.next_entry()? {
        if let Some(state) = entry.decode::<OdometryStateTopic>()? {
            // A stage that came back sends its last states again.
            if last.is_some_and(|last| state.head.id <= last) {
                continue;
            }
            last = Some(state.head.id);
            let (stamp_ns, frame) = (state.head.header.stamp_ns, state.head.odom_frame_id);
            let pose = Pose2::from_array(state.head.pose);
            odometry.push(stamp_ns, frame, pose);
            // Parts of the map have nothing in common, so each is a frame.
            if let Some(correction) = correction.filter(|c| c.odom_frame_id == frame) {
                let odom = Pose2::from_array(correction.map_from_odom);
                map.push(stamp_ns, correction.component, odom.compose(&pose));
            }
        } else if let Some(message) = entry.decode::<MapperCorrection>()? {
            correction = Some(*message.head);
        } else if let Some(pose) = entry.decode::<TruthPoseTopic>()? {
            let pose = &pose.head;
            truth.push(pose.header.stamp_ns, 0, Pose2::from_array(pose.pose));
        }
    }
    let mut poses = 0;
    for (name, trajectory) in [
        ("odometry.tum", odometry),
        ("map.tum", map),
        ("truth.tum", truth),
    ] {
        if !trajectory.poses().is_empty() {
            write_whole(&folder.join(name), trajectory.to_tum().as_bytes())?;
            poses += trajectory.poses().len() as u64;
        }
    }
    Ok(count(poses, "pose", "poses"))
}
