//! What a run leaves behind: trajectories, picture, report.

use crate::output::write_whole;
use anyhow::Context;
use randt_evaluation::{
    Evaluation, Plot, Trajectory, evaluate, plot_trajectories, truth_on_estimate,
};
use randt_geometry::Pose2;
use randt_messages::{Keyframe, MessageRef, OdometryState, Trust, TruthPose};
use randt_odometry::Sink;
use std::path::Path;

/// Most points of the map in the picture; more would only make the file larger.
const PICTURE_POINTS_MAX: usize = 60_000;
/// Of each keyframe every so many points go into the picture.
const PICTURE_STRIDE: usize = 4;

/// Collects what the pipeline publishes.
#[derive(Debug, Default)]
pub struct Results {
    /// The live state of every scan.
    pub states: Vec<OdometryState>,
    /// Number of keyframes.
    pub keyframes: u64,
    /// Points of the keyframes of the first frame, in `odom`.
    map: Vec<[f64; 2]>,
    /// The truth, where the log has it; never given to the pipeline.
    truth: Trajectory,
}

impl Sink for Results {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(*state);
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.keyframes += 1;
        if keyframe.head.odom_frame_id != 0 || self.map.len() >= PICTURE_POINTS_MAX {
            return;
        }
        let pose = Pose2::from_array(keyframe.head.pose);
        self.map
            .extend(keyframe.items.iter().step_by(PICTURE_STRIDE).map(|point| {
                let p = pose.transform([f64::from(point.x_m), f64::from(point.y_m)].into());
                [p.x, p.y]
            }));
    }
}

/// Scans of one odometry frame.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct FrameSpan {
    /// The frame's number.
    pub odom_frame_id: u64,
    /// Stamp of its first scan, ns.
    pub begin_ns: i64,
    /// Stamp of its last scan, ns.
    pub end_ns: i64,
    /// Number of its scans.
    pub scans: u64,
}

/// How many scans could be trusted how far.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct TrustCount {
    /// Fixed by the scan in every direction.
    pub good: u64,
    /// Held by gyro or motion model in some direction.
    pub degraded: u64,
    /// Given up.
    pub lost: u64,
}

impl Results {
    /// Keeps a true pose for the evaluation.
    pub fn add_truth(&mut self, truth: &TruthPose) {
        if self.truth.poses().is_empty() {
            self.truth = Trajectory::stamped();
        }
        self.truth
            .push(truth.header.stamp_ns, 0, Pose2::from_array(truth.pose));
    }

    /// The live poses, in `odom`.
    pub fn odometry(&self) -> Trajectory {
        let mut trajectory = Trajectory::stamped();
        for state in &self.states {
            trajectory.push(
                state.header.stamp_ns,
                state.odom_frame_id,
                Pose2::from_array(state.pose),
            );
        }
        trajectory
    }

    /// How exact the trajectory is, where the log has the truth.
    pub fn evaluation(&self) -> Option<Evaluation> {
        if self.truth.poses().is_empty() {
            return None;
        }
        evaluate(&self.odometry(), &self.truth).ok()
    }

    /// The odometry frames, in order.
    pub fn frames(&self) -> Vec<FrameSpan> {
        let same = |a: &OdometryState, b: &OdometryState| a.odom_frame_id == b.odom_frame_id;
        let span = |states: &[OdometryState]| match states {
            [first, ..] => Some(FrameSpan {
                odom_frame_id: first.odom_frame_id,
                begin_ns: first.header.stamp_ns,
                end_ns: states
                    .last()
                    .map_or(first.header.stamp_ns, |last| last.header.stamp_ns),
                scans: states.len() as u64,
            }),
            [] => None,
        };
        self.states.chunk_by(same).filter_map(span).collect()
    }

    /// Length of the live path, m; frames are not joined.
    pub fn path_m(&self) -> f64 {
        let step = |pair: &[OdometryState]| match pair {
            [a, b] if a.odom_frame_id == b.odom_frame_id => Pose2::from_array(a.pose)
                .between(&Pose2::from_array(b.pose))
                .translation()
                .norm(),
            _ => 0.0,
        };
        self.states.windows(2).map(step).sum()
    }

    /// How far the poses can be trusted.
    pub fn trust(&self) -> TrustCount {
        let mut count = TrustCount::default();
        for state in &self.states {
            match state.trust {
                t if t == Trust::Good as u32 => count.good += 1,
                t if t == Trust::Degraded as u32 => count.degraded += 1,
                _ => count.lost += 1,
            }
        }
        count
    }

    /// Writes `odometry.tum`, `trajectory.tum` and `plot.svg`; gives the trajectory's text.
    pub fn write(&self, folder: &Path, title: &str) -> anyhow::Result<String> {
        let trajectory = self.odometry();
        let rows = trajectory.to_tum();
        write_whole(&folder.join("odometry.tum"), rows.as_bytes())?;
        // Until loops are closed the final pose of a scan is its live one.
        write_whole(&folder.join("trajectory.tum"), rows.as_bytes())?;
        let picture = self.picture(&trajectory, title).context("plot.svg")?;
        write_whole(&folder.join("plot.svg"), picture.as_bytes())?;
        Ok(rows)
    }

    fn picture(&self, trajectory: &Trajectory, title: &str) -> anyhow::Result<String> {
        let same = |a: &OdometryState, b: &OdometryState| a.odom_frame_id == b.odom_frame_id;
        let position = |state: &OdometryState| [state.pose[0], state.pose[1]];
        // Frames have nothing in common but the picture; the first one is the map's.
        let estimate: Vec<Vec<[f64; 2]>> = self
            .states
            .chunk_by(same)
            .map(|frame| frame.iter().map(position).collect())
            .collect();
        let truth = match self.truth.poses() {
            [] => Vec::new(),
            _ => truth_on_estimate(trajectory, &self.truth)?,
        };
        Ok(plot_trajectories(&Plot {
            title,
            estimate: &estimate,
            truth: &truth,
            map: &self.map,
            loops: &[],
        })?)
    }
}
