//! What viewers see of a run: which message of ours becomes which of theirs in the log, and when.

use crate::Raw;
use randt_config::{Config, Robot};
use randt_foxglove_schemas::topic::{
    CELLS, CLOUD_PERIOD_NS, GRAPH, GRID, LOOPS, POINTS, POSE, TRANSFORMS,
};
use randt_foxglove_schemas::{self as schemas, Graph, Pace, SubmapCells, Tiles};
use randt_geometry::Quaternion;
use randt_messages::{
    Correction, Keyframe, MapperCorrection, MapperGraph, MapperGrid, OdometryState,
    OdometryStateTopic, RadarPoints, Topic,
};
use randt_ros_messages::{Style, Transform, occupancy_grid, pose_stamped, transforms};

/// A drawing of what changes goes as often as this.
const PERIOD_NS: i64 = 2_000_000_000;
/// A grid that changes is recorded with that period, or as rarely as a large one needs, so that as
/// a picture it takes no more than this before compression, ...
const GRID_BYTES_PER_SECOND: i64 = 500_000;
/// ... but whole each minute, changed or not.
const GRID_PERIOD_MAX_NS: i64 = 60_000_000_000;
/// Likewise the graph, of which a keyframe takes that much, ...
const GRAPH_BYTES_PER_SECOND: i64 = 5_000;
const NODE_BYTES: usize = 24;
/// ... and the cells of a submap, some 500 in a hall: every 8 s.
const CELLS_BYTES_PER_SECOND: i64 = 15_000;
const CELL_BYTES: usize = 240;

/// Follows a run and gives the messages for viewers.
#[derive(Debug)]
pub struct Viewer {
    robot: Robot,
    cloud_ns: Option<i64>,
    correction: Option<Correction>,
    tiles: Tiles,
    has_changed: bool,
    grid_ns: Option<i64>,
    graph: Graph,
    graph_pace: Pace,
    cells: SubmapCells,
    cells_pace: Pace,
}

impl Viewer {
    /// At the beginning of a run.
    pub fn new(config: &Config) -> Self {
        Self {
            robot: config.robot.clone(),
            cloud_ns: None,
            correction: None,
            tiles: Tiles::default(),
            has_changed: false,
            grid_ns: None,
            graph: Graph::default(),
            graph_pace: Pace::new(PERIOD_NS, GRAPH_BYTES_PER_SECOND),
            cells: SubmapCells::new(config),
            cells_pace: Pace::new(PERIOD_NS, CELLS_BYTES_PER_SECOND),
        }
    }

    /// A new file begins: it shows everything by itself.
    pub fn begin(&mut self) {
        self.grid_ns = None;
        self.graph_pace.restart();
        self.cells_pace.restart();
    }

    /// What a message of ours becomes.
    pub fn take(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        if raw.topic == RadarPoints::NAME {
            self.take_points(raw, out);
        } else if let Some(state) = raw.decode::<OdometryStateTopic>() {
            self.take_state(&state.head, raw, out);
        } else if let Some(correction) = raw.decode::<MapperCorrection>() {
            self.take_correction(*correction.head);
        } else if let Some(tile) = raw.decode::<MapperGrid>() {
            self.tiles.take(tile);
            self.has_changed = true;
        } else if let Some(page) = raw.decode::<MapperGraph>() {
            // It comes again and again, changed or not.
            let before = self.graph.version();
            if self.graph.take(page.as_ref()) && before != self.graph.version() {
                self.graph_pace.change();
            }
        } else if let Some(keyframe) = raw.decode::<Keyframe>() {
            self.graph
                .know(keyframe.head.id, keyframe.head.odom_frame_id);
            self.cells.take(keyframe);
            self.cells_pace.change();
        }
    }

    fn take_correction(&mut self, correction: Correction) {
        let known = self.correction.replace(correction);
        if known.is_some_and(|known| known.graph_version > correction.graph_version) {
            // Another drive: the map before is void.
            self.tiles = Tiles::default();
            self.grid_ns = None;
            self.graph = Graph::default();
        }
    }

    fn take_points(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        let now_ns = raw.label.time_ns;
        if !is_early(self.cloud_ns, now_ns, CLOUD_PERIOD_NS)
            && let Some(points) = raw.decode::<RadarPoints>()
        {
            self.cloud_ns = Some(now_ns);
            show(raw, POINTS, schemas::recorded_points(points.as_ref()), out);
        }
    }

    fn take_state(&mut self, state: &OdometryState, raw: &Raw, out: &mut Vec<Raw>) {
        let (now_ns, stamp_ns) = (raw.label.time_ns, state.header.stamp_ns);
        show(raw, POSE, pose_stamped(Style::Cdr, state), out);
        // All of them with every state: the frames are known in every part of a log.
        let frames = self.frames(state);
        show(
            raw,
            TRANSFORMS,
            transforms(Style::Cdr, stamp_ns, &frames),
            out,
        );
        if self.is_grid_due(now_ns)
            && let Some(cells) = self.tiles.cells()
        {
            show(raw, GRID, occupancy_grid(Style::Cdr, stamp_ns, &cells), out);
        }
        let nodes = self.graph.nodes().count();
        if nodes > 0 && self.graph_pace.is_due(now_ns, nodes * NODE_BYTES) {
            show(
                raw,
                GRAPH,
                schemas::graph_markers(&self.graph, stamp_ns),
                out,
            );
            show(
                raw,
                LOOPS,
                schemas::loop_markers(&self.graph, stamp_ns),
                out,
            );
        }
        let (cells, root) = self.cells.cells();
        let count = self.cells.cells().0.count();
        if count > 0 && self.cells_pace.is_due(now_ns, count * CELL_BYTES) {
            show(
                raw,
                CELLS,
                schemas::cell_markers(cells, root, stamp_ns),
                out,
            );
        }
    }

    /// Where the sensors sit, the robot in `odom`, and `odom` in `map` once that is known.
    fn frames(&self, state: &OdometryState) -> Vec<Transform> {
        let it = &self.robot;
        let radar = [it.radar_x_m, it.radar_y_m, it.radar_yaw_rad];
        let imu =
            Quaternion::from_roll_pitch_yaw(it.imu_roll_rad, it.imu_pitch_rad, it.imu_yaw_rad);
        let mut frames = Transform::mounting(radar, imu.to_array()).to_vec();
        frames.push(Transform::odometry(state));
        frames.extend(self.correction.as_ref().map(Transform::correction));
        frames
    }

    fn is_grid_due(&mut self, now_ns: i64) -> bool {
        let Some(size) = self.tiles.size() else {
            return false;
        };
        let paced_ns = size.saturating_mul(1_000_000_000) / GRID_BYTES_PER_SECOND;
        let pause_ns = match self.has_changed {
            true => paced_ns.clamp(PERIOD_NS, GRID_PERIOD_MAX_NS),
            false => GRID_PERIOD_MAX_NS,
        };
        let is_due = !is_early(self.grid_ns, now_ns, pause_ns);
        if is_due {
            (self.grid_ns, self.has_changed) = (Some(now_ns), false);
        }
        is_due
    }
}

/// Whether the pause since the last one is not over. A clock that jumps back is no reason to wait.
fn is_early(last_ns: Option<i64>, now_ns: i64, pause_ns: i64) -> bool {
    last_ns.is_some_and(|last_ns| (0..pause_ns).contains(&(now_ns - last_ns)))
}

/// Adds a message for viewers, recorded with the one that it was made of.
fn show(source: &Raw, topic: &'static str, bytes: Vec<u8>, out: &mut Vec<Raw>) {
    out.push(Raw {
        topic,
        label: source.label,
        bytes,
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::{Message, TILE_CELLS};

    const S: i64 = 1_000_000_000;

    fn tile(cell: u8) -> Raw {
        let mut tile = Message::<MapperGrid>::default();
        tile.head.resolution_m = 0.1;
        tile.items = vec![cell; TILE_CELLS * TILE_CELLS];
        Raw::from_message(tile.as_ref())
    }

    #[test]
    fn another_drive_begins_with_an_empty_map() {
        let mut viewer = Viewer::new(&Config::default());
        let correct = |viewer: &mut Viewer, version| {
            let mut correction = Message::<MapperCorrection>::default();
            correction.head.graph_version = version;
            viewer.take(&Raw::from_message(correction.as_ref()), &mut Vec::new());
        };
        viewer.take(&tile(0), &mut Vec::new());
        correct(&mut viewer, 7);
        correct(&mut viewer, 8);
        assert!(viewer.tiles.size().is_some());
        correct(&mut viewer, 1);
        assert!(viewer.tiles.size().is_none());
    }

    #[test]
    fn the_grid_is_shown_when_it_changes_each_minute_and_in_each_file() {
        let mut viewer = Viewer::new(&Config::default());
        let shown = |viewer: &mut Viewer, time_ns| {
            let mut state = Raw::from_message(Message::<OdometryStateTopic>::default().as_ref());
            state.label.time_ns = time_ns;
            let mut out = Vec::new();
            viewer.take(&state, &mut out);
            out.iter().any(|raw| raw.topic == GRID)
        };
        assert!(!shown(&mut viewer, 0));
        viewer.take(&tile(0), &mut Vec::new());
        assert!(shown(&mut viewer, 0) && !shown(&mut viewer, 10 * S));
        viewer.take(&tile(50), &mut Vec::new());
        assert!(!shown(&mut viewer, S) && shown(&mut viewer, 2 * S));
        assert!(!shown(&mut viewer, 61 * S) && shown(&mut viewer, 62 * S));
        viewer.begin();
        assert!(shown(&mut viewer, 63 * S));
    }
}
