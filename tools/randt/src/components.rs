//! A trajectory by components of the map: what no loop joins has a frame of its own, and no place
//! in the others'.

use randt_evaluation::{Trajectory, TrajectoryPose};
use std::collections::BTreeMap;

/// Positions, m.
pub type Line = Vec<[f64; 2]>;

/// What a picture shows in its own frame, and what it shows apart.
#[derive(Debug)]
pub struct Components {
    /// The component whose frame the picture has.
    pub component: u64,
    /// Its poses.
    pub shown: Trajectory,
    /// Its lines, m: one for each stretch between two others.
    pub lines: Vec<Line>,
    /// The lines of each other one, in its own frame, m.
    pub apart: Vec<Vec<Line>>,
}

impl Components {
    /// Each pose of the trajectory names its component as its frame. Where none is of the one that
    /// is asked for, that of most poses is shown.
    pub fn from_trajectory(trajectory: &Trajectory, component: u64) -> Self {
        let mut sizes: BTreeMap<u64, usize> = BTreeMap::new();
        for pose in trajectory.poses() {
            *sizes.entry(pose.frame).or_default() += 1;
        }
        let largest = sizes.iter().max_by_key(|(_, size)| **size);
        let component = match (sizes.contains_key(&component), largest) {
            (false, Some((largest, _))) => *largest,
            _ => component,
        };
        let mut parts: BTreeMap<u64, Vec<Line>> = BTreeMap::new();
        for poses in trajectory.poses().chunk_by(|a, b| a.frame == b.frame) {
            let line = poses.iter().map(TrajectoryPose::position_m).collect();
            if let Some(first) = poses.first() {
                parts.entry(first.frame).or_default().push(line);
            }
        }
        Self {
            component,
            shown: trajectory.of_frame(component),
            lines: parts.remove(&component).unwrap_or_default(),
            apart: parts.into_values().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::Pose2;

    fn drive(frames: &[u64]) -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        for (step, frame) in frames.iter().enumerate() {
            trajectory.push(step as i64, *frame, Pose2::new(step as f64, 0.0, 0.0));
        }
        trajectory
    }

    #[test]
    fn what_is_not_joined_is_apart_and_a_component_that_is_met_again_is_one() {
        let parts = Components::from_trajectory(&drive(&[5, 5, 7, 7, 7, 5, 9]), 5);
        assert_eq!((parts.component, parts.shown.poses().len()), (5, 3));
        assert_eq!(
            parts.lines,
            [vec![[0.0, 0.0], [1.0, 0.0]], vec![[5.0, 0.0]]]
        );
        assert_eq!(
            parts.apart,
            [
                vec![vec![[2.0, 0.0], [3.0, 0.0], [4.0, 0.0]]],
                vec![vec![[6.0, 0.0]]],
            ]
        );
        let met_again = Components::from_trajectory(&drive(&[5, 5, 7, 7, 7, 5, 9]), 7);
        let lines: Vec<usize> = met_again.apart.iter().map(Vec::len).collect();
        assert_eq!(lines, [2, 1]);
    }

    #[test]
    fn without_the_one_that_is_asked_for_the_longest_is_shown() {
        assert_eq!(
            Components::from_trajectory(&drive(&[1, 2, 2]), 0).component,
            2
        );
        assert_eq!(Components::from_trajectory(&drive(&[]), 3).component, 3);
    }
}
