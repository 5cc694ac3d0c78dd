//! What viewers see of a run: which message of ours becomes which of theirs in the log, and when.

use crate::Raw;
use randt_config::Robot;
use randt_foxglove_schemas::topic::{GRID, POINTS, POSE, TRANSFORMS};
use randt_foxglove_schemas::{self as schemas, Encode, Tiles, ViewerTopic};
use randt_messages::{
    Correction, MapperCorrection, MapperGrid, Message, OdometryState, OdometryStateTopic,
    RadarPoints, Topic,
};

/// A grid that changes is recorded with its period, or as rarely as a large one needs, so that it
/// takes no more than this before compression, ...
const GRID_BYTES_PER_SECOND: i64 = 500_000;
/// ... but whole each minute, changed or not.
const GRID_PERIOD_MAX_NS: i64 = 60_000_000_000;

/// Follows a run and gives the messages for viewers.
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

    /// A new file begins: it shows everything by itself.
    pub fn begin(&mut self) {
        self.grid_ns = None;
    }

    /// What a message of ours becomes.
    pub fn take(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        if raw.topic == RadarPoints::NAME {
            self.take_points(raw, out);
        } else if let Some(state) = message::<OdometryStateTopic>(raw) {
            self.take_state(&state.head, raw, out);
        } else if let Some(correction) = message::<MapperCorrection>(raw) {
            self.take_correction(*correction.head);
        } else if let Some(tile) = message::<MapperGrid>(raw) {
            self.tiles.take(tile);
            self.has_changed = true;
        }
    }

    fn take_correction(&mut self, correction: Correction) {
        let known = self.correction.replace(correction);
        if known.is_some_and(|known| known.graph_version > correction.graph_version) {
            // Another drive: the map before is void.
            self.tiles = Tiles::default();
            self.grid_ns = None;
        }
    }

    fn take_points(&mut self, raw: &Raw, out: &mut Vec<Raw>) {
        let now_ns = raw.label.time_ns;
        let pause_ns = ViewerTopic::Points.recorded_period_ns();
        if !is_early(self.cloud_ns, now_ns, pause_ns)
            && let Some(points) = message::<RadarPoints>(raw)
        {
            self.cloud_ns = Some(now_ns);
            show(raw, POINTS, &schemas::of_points(points.as_ref()), out);
        }
    }

    fn take_state(&mut self, state: &OdometryState, raw: &Raw, out: &mut Vec<Raw>) {
        show(raw, POSE, &schemas::pose_of_state(state), out);
        // All of them with every state: the frames are known in every part of a log.
        let frames = schemas::transforms(&self.robot, state, self.correction.as_ref());
        show(raw, TRANSFORMS, &frames, out);
        if self.is_grid_due(raw.label.time_ns)
            && let Some(grid) = self.tiles.draw(state.header.stamp_ns)
        {
            show(raw, GRID, &grid, out);
        }
    }

    fn is_grid_due(&mut self, now_ns: i64) -> bool {
        let Some(size) = self.tiles.size() else {
            return false;
        };
        let paced_ns = size.saturating_mul(1_000_000_000) / GRID_BYTES_PER_SECOND;
        let pause_ns = match self.has_changed {
            true => paced_ns.clamp(ViewerTopic::Grid.recorded_period_ns(), GRID_PERIOD_MAX_NS),
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

/// The message, where it is of this topic.
fn message<T: Topic>(raw: &Raw) -> Option<Message<T>> {
    (raw.topic == T::NAME).then(|| Message::from_bytes(&raw.bytes))?
}

/// Adds a message for viewers, recorded with the one that it was made of.
fn show(source: &Raw, topic: &'static str, message: &impl Encode, out: &mut Vec<Raw>) {
    out.extend(schemas::bytes(message).map(|bytes| Raw {
        topic,
        label: source.label,
        bytes,
    }));
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
        Raw::from_message(tile.as_ref())
    }

    #[test]
    fn another_drive_begins_with_an_empty_map() {
        let mut viewer = Viewer::new(Robot::default());
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
        let mut viewer = Viewer::new(Robot::default());
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
