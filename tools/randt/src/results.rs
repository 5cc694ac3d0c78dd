//! What a run leaves behind: trajectories, picture, report.

use crate::components::Components;
use crate::map_png::map_png;
use crate::odometry_csv::odometry_csv;
use anyhow::Context;
use randt_evaluation::{
    Evaluation, Plot, Trajectory, evaluate, plot_trajectories, truth_on_estimate,
};
use randt_geometry::Pose2;
use randt_mapper::{KeyframeIdx, Mapper};
use randt_messages::{Keyframe, MessageRef, OdometryState, Trust, TruthPose};
use randt_odometry::Sink;
use std::collections::HashSet;
use std::path::Path;

/// Most points of the map in the picture; more would only make the file larger.
const PICTURE_POINTS_MAX: usize = 60_000;
/// Of each keyframe every fourth point goes into the picture.
const PICTURE_STRIDE: usize = 4;

/// A file's name and bytes, or why there are none.
pub type File = (&'static str, anyhow::Result<Vec<u8>>);

/// Collects what the pipeline publishes.
#[derive(Debug, Default)]
pub struct Results {
    /// The live state of every scan.
    pub states: Vec<OdometryState>,
    /// The scans that have one, where states come from several places and each counts once.
    known: Option<HashSet<(u64, u64)>>,
    /// The truth, where the log has it; never given to the pipeline.
    truth: Trajectory,
}

impl Sink for Results {
    fn state(&mut self, state: &OdometryState) {
        let Some(known) = &mut self.known else {
            self.states.push(*state);
            return;
        };
        if known.insert((state.scan_epoch, state.scan_sequence)) {
            let order = |state: &OdometryState| (state.odom_frame_id, state.header.stamp_ns);
            let before = |other: &OdometryState| order(other) < order(state);
            let at = self.states.iter().rposition(before).map_or(0, |i| i + 1);
            self.states.insert(at, *state);
        }
    }

    fn keyframe(&mut self, _: MessageRef<'_, Keyframe>) {}
}

/// Scans of one odometry frame.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct TrustCount {
    /// Fixed by the scan in every direction.
    pub good: u64,
    /// Held by gyro or motion model in some direction, or fitting poorly.
    pub degraded: u64,
    /// Given up.
    pub lost: u64,
}

impl Results {
    /// Of a drive whose states come from several places: each scan's counts once, in the order of
    /// frames and stamps.
    pub fn merged() -> Self {
        Self {
            known: Some(HashSet::new()),
            ..Self::default()
        }
    }

    /// States that odometry has numbered and that are not here.
    pub fn states_missing(&self) -> u64 {
        let before = std::iter::once(None).chain(self.states.iter().map(Some));
        let missing = |(before, state): (Option<&OdometryState>, &OdometryState)| {
            // A number that does not rise is that of an odometry that began without its past.
            let next = before.map_or(0, |before| before.id + 1);
            state.id.checked_sub(next).unwrap_or(state.id)
        };
        before.zip(&self.states).map(missing).sum()
    }

    /// Keeps a true pose for the evaluation.
    pub fn add_truth(&mut self, truth: &TruthPose) {
        if self.truth.poses().is_empty() {
            self.truth = Trajectory::stamped();
        }
        self.truth
            .push(truth.header.stamp_ns, 0, Pose2::from_array(truth.pose));
    }

    /// The true poses; none where the log does not have them.
    pub fn truth(&self) -> &Trajectory {
        &self.truth
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

    /// How exact a trajectory is, where the log has the truth.
    pub fn evaluation(&self, trajectory: &Trajectory) -> Option<Evaluation> {
        if self.truth.poses().is_empty() {
            return None;
        }
        evaluate(trajectory, &self.truth).ok()
    }

    /// The odometry frames, in order.
    pub fn frames(&self) -> Vec<FrameSpan> {
        let same = |a: &OdometryState, b: &OdometryState| a.odom_frame_id == b.odom_frame_id;
        let span = |states: &[OdometryState]| match states {
            [first, ..] => Some(FrameSpan {
                odom_frame_id: first.odom_frame_id,
                begin_ns: first.header.stamp_ns,
                end_ns: states.last().unwrap_or(first).header.stamp_ns,
                scans: states.len() as u64,
            }),
            [] => None,
        };
        self.states.chunk_by(same).filter_map(span).collect()
    }

    /// Length of the live path, m; frames are not merged.
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
            match state.trust() {
                Trust::Good => count.good += 1,
                Trust::Degraded => count.degraded += 1,
                Trust::Lost => count.lost += 1,
            }
        }
        count
    }

    /// Trajectories and map, each with its name, or why it is not there.
    pub fn files(&self, trajectory: &Trajectory, mapper: &Mapper) -> Vec<File> {
        // As Nav2's map_server reads them.
        let picture = mapper.grid().picture();
        let picture = |name| picture.as_ref().with_context(|| too_wide(name));
        let map = picture("map.pgm").map(|it| it.to_pgm());
        let about = picture("map.yaml").map(|it| it.to_yaml("map.pgm").into_bytes());
        // For people: with path and scale.
        let shown = picture("map.png");
        let shown = shown.and_then(|it| map_png(it, trajectory, largest_component(mapper)));
        vec![
            ("odometry.csv", Ok(odometry_csv(&self.states).into_bytes())),
            ("odometry.tum", Ok(self.odometry().to_tum().into_bytes())),
            ("trajectory.tum", Ok(trajectory.to_tum().into_bytes())),
            ("keyframes.tum", Ok(keyframes(mapper).to_tum().into_bytes())),
            ("map.pgm", map),
            ("map.yaml", about),
            ("map.png", shown.context("map.png")),
        ]
    }

    /// The picture: what stands in the map's largest component is drawn with its returns and
    /// loops, the others as lines apart.
    pub fn picture(
        &self,
        trajectory: &Trajectory,
        title: &str,
        mapper: &Mapper,
    ) -> anyhow::Result<String> {
        let parts = Components::from_trajectory(trajectory, largest_component(mapper));
        let truth = match self.truth.poses() {
            [] => Vec::new(),
            _ => truth_on_estimate(&parts.shown, &self.truth)?,
        };
        let component = mapper.largest_component();
        let pose = |keyframe: KeyframeIdx| mapper.poses().get(keyframe.0);
        let position = |keyframe| pose(keyframe).map(|pose| [pose.x_m, pose.y_m]);
        let loops: Vec<[[f64; 2]; 2]> = mapper
            .accepted()
            .filter(|l| mapper.component_of(l.newer) == component)
            .filter_map(|l| Some([position(l.older)?, position(l.newer)?]))
            .collect();
        Ok(plot_trajectories(&Plot {
            title,
            estimate: &parts.lines,
            live: &[],
            truth: &truth,
            map: &returns(mapper),
            loops: &loops,
            apart: &parts.apart,
        })?)
    }
}

/// The map's largest component, as trajectories name it.
fn largest_component(mapper: &Mapper) -> u64 {
    let first = mapper.largest_component().first_keyframe();
    let first = mapper.keyframes().get(first.0);
    first.map_or(0, |keyframe| keyframe.odom_frame_id)
}

fn too_wide(name: &str) -> String {
    format!(
        "{name}: the map has more cells than a picture may have; a larger grid.cell_size_m makes fewer"
    )
}

/// Removes a file, if there is one.
pub fn remove(path: &Path) -> anyhow::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("{}: cannot be removed", path.display()))
        }
        _ => Ok(()),
    }
}

/// The keyframes as the graph has them.
fn keyframes(mapper: &Mapper) -> Trajectory {
    let mut trajectory = Trajectory::stamped();
    for (index, (keyframe, pose)) in mapper.keyframes().iter().zip(mapper.poses()).enumerate() {
        let component = mapper.component_of(KeyframeIdx(index));
        trajectory.push(keyframe.stamp_ns, component.0 as u64, *pose);
    }
    trajectory
}

/// Returns of the map's largest component, thinned out.
fn returns(mapper: &Mapper) -> Vec<[f64; 2]> {
    let component = mapper.largest_component();
    let all = mapper.keyframes().iter().zip(mapper.poses()).enumerate();
    let keyframes = all
        .filter(|(index, _)| mapper.component_of(KeyframeIdx(*index)) == component)
        .map(|(_, (keyframe, pose))| (pose, keyframe.observation.points.as_slice()));
    thinned_returns(keyframes, PICTURE_STRIDE, |point| [point.x_m, point.y_m])
}

/// Returns of keyframes that stand at poses of the map: every one of `stride_min`, or fewer where
/// there are too many for a picture.
pub fn thinned_returns<'a, P: 'a>(
    keyframes: impl Iterator<Item = (&'a Pose2, &'a [P])> + Clone,
    stride_min: usize,
    position_m: fn(&P) -> [f32; 2],
) -> Vec<[f64; 2]> {
    let total: usize = keyframes.clone().map(|(_, points)| points.len()).sum();
    let stride = (total / PICTURE_POINTS_MAX).max(stride_min);
    let points = keyframes.flat_map(|(pose, points)| {
        let points = points.iter().step_by(stride);
        points.map(move |point| pose.transform(position_m(point).map(f64::from).into()))
    });
    points.map(|at| [at.x, at.y]).collect()
}

#[cfg(test)]
mod tests;
