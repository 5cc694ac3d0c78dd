//! What viewers see of a run: which topics there are for them in the log, and how often something goes by them.

use crate::Raw;
use randt_config::Robot;
use randt_foxglove_schemas::topic::{GRID, POINTS, POSE, TRANSFORMS};
use randt_foxglove_schemas::{FrameTransforms, Grid, PointCloud, PoseInFrame, Tiles};
use randt_log::Channel;
use randt_messages::{
    Correction, MapperCorrection, MapperGrid, Message, OdometryState, OdometryStateTopic,
    RadarPoints, Topic,
};

/// A cloud is shown once a second, give or take a sweep: each takes as much as its scan does.
const CLOUD_PERIOD_NS: i64 = 950_000_000;
/// A grid that changes is shown so often ...
const GRID_PERIOD_NS: i64 = 2_000_000_000;
/// ... or as seldom as a large one needs, so that it takes no more than this before compression, ...
const GRID_BYTES_PER_SECOND: i64 = 500_000;
/// ... but whole each minute, changed or not.
const GRID_PERIOD_MAX_NS: i64 = 60_000_000_000;

/// The channel of a topic for viewers; `None` for any other.
pub(crate) fn channel(topic: &str) -> Option<Channel> {
    use randt_foxglove_schemas::channel;
    match topic {
        POSE => Some(channel::<PoseInFrame>(POSE)),
        TRANSFORMS => Some(channel::<FrameTransforms>(TRANSFORMS)),
        POINTS => Some(channel::<PointCloud>(POINTS)),
        GRID => Some(channel::<Grid>(GRID)),
        _ => None,
    }
}

/// Follows a run and says what a viewer needs to see of it.
#[derive(Debug)]
pub struct Viewer {
    robot: Robot,
    cloud_ns: Option<i64>,
    correction: Option<Correction>,
    tiles: Tiles,
    has_changed: bool,
    grid_ns: Option<i64>,
}

impl Viewer {
    /// At the beginning of a run.
    pub fn new(robot: Robot) -> Self {
        Self {
            robot,
            cloud_ns: None,
            correction: None,
            tiles: Tiles::default(),
            has_changed: false,
            grid_ns: None,
        }
    }

    /// A new file begins: it shall show everything by itself.
    pub fn begin(&mut self) {
        self.grid_ns = None;
    }

    /// What a message of ours becomes.
    pub fn see(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        if raw.topic == OdometryStateTopic::NAME {
            let Some(state) = Message::<OdometryStateTopic>::from_bytes(&raw.bytes) else {
                return;
            };
            self.see_state(&state.head, raw, out);
        } else if raw.topic == MapperCorrection::NAME {
            if let Some(message) = Message::<MapperCorrection>::from_bytes(&raw.bytes) {
                self.see_correction(*message.head);
            }
        } else if raw.topic == RadarPoints::NAME {
            self.see_points(raw, out);
        } else if raw.topic == MapperGrid::NAME
            && let Some(tile) = Message::<MapperGrid>::from_bytes(&raw.bytes)
        {
            self.tiles.take(tile);
            self.has_changed = true;
        }
    }

    fn see_correction(&mut self, correction: Correction) {
        let known = self.correction.replace(correction);
        if known.is_some_and(|known| known.graph_version > correction.graph_version) {
            // Another drive: nothing of the map before holds any more.
            self.tiles = Tiles::default();
            self.grid_ns = None;
        }
    }

    fn see_points(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        let now_ns = raw.label.time_ns;
        if is_early(self.cloud_ns, now_ns, CLOUD_PERIOD_NS) {
            return;
        }
        if let Some(points) = Message::<RadarPoints>::from_bytes(&raw.bytes) {
            self.cloud_ns = Some(now_ns);
            let cloud = randt_foxglove_schemas::of_points(points.as_ref());
            out.extend(with(raw, POINTS, randt_foxglove_schemas::bytes(&cloud)));
        }
    }

    fn see_state(&mut self, state: &OdometryState, raw: &Raw, out: &mut Vec<Raw>) {
        let pose = randt_foxglove_schemas::pose_of_state(state);
        out.extend(with(raw, POSE, randt_foxglove_schemas::bytes(&pose)));
        // All of them with every state: whatever part of a log is looked at, the frames are known.
        let frames =
            randt_foxglove_schemas::transforms(&self.robot, state, self.correction.as_ref());
        out.extend(with(
            raw,
            TRANSFORMS,
            randt_foxglove_schemas::bytes(&frames),
        ));
        if self.is_grid_due(raw.label.time_ns) {
            let grid = self.tiles.draw(state.header.stamp_ns);
            let bytes = grid.and_then(|grid| randt_foxglove_schemas::bytes(&grid));
            out.extend(with(raw, GRID, bytes));
        }
    }

    fn is_grid_due(&mut self, now_ns: i64) -> bool {
        let Some(size) = self.tiles.size() else {
            return false;
        };
        let paced_ns = size.saturating_mul(1_000_000_000) / GRID_BYTES_PER_SECOND;
        let pause_ns = match self.has_changed {
            true => paced_ns.clamp(GRID_PERIOD_NS, GRID_PERIOD_MAX_NS),
            false => GRID_PERIOD_MAX_NS,
        };
        if is_early(self.grid_ns, now_ns, pause_ns) {
            return false;
        }
        self.grid_ns = Some(now_ns);
        self.has_changed = false;
        true
    }
}

/// Whether the pause since the last one is not over. A clock that jumps back is no reason to wait.
fn is_early(last_ns: Option<i64>, now_ns: i64, pause_ns: i64) -> bool {
    last_ns.is_some_and(|last_ns| (0..pause_ns).contains(&(now_ns - last_ns)))
}

/// A message for viewers, recorded with the one that it was made of.
fn with(of: &Raw, topic: &'static str, bytes: Option<Vec<u8>>) -> Option<Raw> {
    let label = of.label;
    bytes.map(|bytes| Raw {
        topic,
        label,
        bytes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::TILE_CELLS;

    const S: i64 = 1_000_000_000;

    fn tile(cell: u8) -> Raw {
        let mut tile = Message::<MapperGrid>::default();
        tile.head.resolution_m = 0.1;
        tile.items = vec![cell; TILE_CELLS * TILE_CELLS];
        Raw::of(tile.as_ref())
    }

    #[test]
    fn another_drive_begins_with_an_empty_map() {
        let mut viewer = Viewer::new(Robot::default());
        let correct = |viewer: &mut Viewer, version| {
            let mut correction = Message::<MapperCorrection>::default();
            correction.head.graph_version = version;
            viewer.see(&Raw::of(correction.as_ref()), &mut Vec::new());
        };
        viewer.see(&tile(0), &mut Vec::new());
        correct(&mut viewer, 7);
        correct(&mut viewer, 8);
        assert!(viewer.tiles.size().is_some());
        correct(&mut viewer, 1);
        assert!(viewer.tiles.size().is_none());
    }

    #[test]
    fn the_grid_is_shown_when_it_changes_each_minute_and_in_each_file() {
        let mut viewer = Viewer::new(Robot::default());
        let shown = |viewer: &mut Viewer, time_ns| {
            let mut state = Raw::of(Message::<OdometryStateTopic>::default().as_ref());
            state.label.time_ns = time_ns;
            let mut out = Vec::new();
            viewer.see(&state, &mut out);
            out.iter().any(|raw| raw.topic == GRID)
        };
        assert!(!shown(&mut viewer, 0));
        viewer.see(&tile(0), &mut Vec::new());
        assert!(shown(&mut viewer, 0) && !shown(&mut viewer, 10 * S));
        viewer.see(&tile(50), &mut Vec::new());
        assert!(!shown(&mut viewer, S) && shown(&mut viewer, 2 * S));
        assert!(!shown(&mut viewer, 61 * S) && shown(&mut viewer, 62 * S));
        viewer.begin();
        assert!(shown(&mut viewer, 63 * S));
    }
}
