//! Our messages as viewers', in the order in which they come: which view each goes to, and how
//! often.

use randt_config::{Config, Robot};
use randt_foxglove_schemas::topic;
use randt_foxglove_schemas::{
    FrameTransforms, Graph, Grid, Log, Pace, PointCloud, PoseInFrame, SceneUpdate, SubmapCells,
    Tiles, channel, mounting, of_drop, of_points, of_scan, pose_of_state, transforms,
};
use randt_log::{Channel, Entry, RecordHeader};
use randt_messages::{
    Correction, Keyframe, LogDropTopic, MapperCorrection, MapperGraph, MapperGrid, OdometryState,
    OdometryStateTopic, RadarPoints, RadarScan, Topic,
};

/// A topic for viewers.
pub struct View {
    pub view: &'static str,
    /// Its schema.
    pub channel: fn(&str) -> Channel,
    /// The topic of ours that it is made of.
    pub from: &'static str,
    /// What a log without that one does not show, for the warning; a log may well have none of the
    /// others.
    pub what: Option<&'static str>,
}

macro_rules! views {
    ($($name:ident = $view:expr, $schema:ty, $from:ty, $what:expr;)+) => {
        $(const $name: &str = $view;)+
        /// All of them.
        pub const TOPICS: [View; [$($view),+].len()] = [$(View {
            view: $view,
            channel: channel::<$schema>,
            from: <$from as Topic>::NAME,
            what: $what,
        }),+];
    };
}

views! {
    TRANSFORMS = topic::TRANSFORMS, FrameTransforms, OdometryStateTopic, None;
    SCAN = "view/scan", PointCloud, RadarScan, Some("raw clouds are");
    POINTS = topic::POINTS, PointCloud, RadarPoints, Some("filtered clouds are");
    POSE = topic::POSE, PoseInFrame, OdometryStateTopic, Some("pose and transforms are");
    CELLS = topic::CELLS, SceneUpdate, Keyframe, Some("NDT cells are");
    GRAPH = topic::GRAPH, SceneUpdate, MapperGraph, Some("the pose graph is");
    LOOPS = topic::LOOPS, SceneUpdate, MapperGraph, Some("loops are");
    GRID = topic::GRID, Grid, MapperGrid, Some("the occupancy grid is");
    MISSING = "view/missing", Log, LogDropTopic, None;
}

/// Graph and grid are shown as often as this, or as seldom as they take no more than this before
/// compression.
const PERIOD_NS: i64 = 2_000_000_000;
const BYTES_PER_SECOND: i64 = 500_000;
/// A node's line, mark and overhead in a drawing, about: only the pace goes by it.
const NODE_BYTES: usize = 100;

/// A message for viewers.
pub struct Shown {
    pub view: &'static str,
    pub label: RecordHeader,
    pub bytes: Vec<u8>,
}

/// Follows a log.
pub struct Translator {
    robot: Robot,
    has_begun: bool,
    newest: Option<u64>,
    /// Stamp of the newest state or keyframe: drawings of the map are as old.
    stamp_ns: i64,
    correction: Option<Correction>,
    cells: SubmapCells,
    graph: Graph,
    graph_pace: Pace,
    tiles: Tiles,
    grid_pace: Pace,
}

impl Translator {
    /// At a log's beginning, with the configuration that it was recorded by.
    pub fn new(config: &Config) -> Self {
        Self {
            robot: config.robot.clone(),
            has_begun: false,
            newest: None,
            stamp_ns: 0,
            correction: None,
            cells: SubmapCells::new(config),
            graph: Graph::default(),
            graph_pace: Pace::new(PERIOD_NS, BYTES_PER_SECOND),
            tiles: Tiles::default(),
            grid_pace: Pace::new(PERIOD_NS, BYTES_PER_SECOND),
        }
    }

    /// What a message becomes.
    pub fn see(&mut self, entry: &Entry<'_>, out: &mut Vec<Shown>) -> Result<(), randt_log::Error> {
        let mut out = Out {
            label: entry.record_header(),
            shown: out,
        };
        if let Some(scan) = entry.decode::<RadarScan>()? {
            self.begin(scan.head.header.stamp_ns, &mut out);
            out.show(SCAN, &of_scan(scan.as_ref()));
        } else if let Some(points) = entry.decode::<RadarPoints>()? {
            self.begin(points.head.header.stamp_ns, &mut out);
            out.show(POINTS, &of_points(points.as_ref()));
        } else if let Some(state) = entry.decode::<OdometryStateTopic>()? {
            self.see_state(&state.head, &mut out);
        } else if let Some(keyframe) = entry.decode::<Keyframe>()? {
            let head = &keyframe.head;
            let stamp_ns = head.header.stamp_ns;
            self.stamp_ns = self.stamp_ns.max(stamp_ns);
            self.graph.know(head.id, head.odom_frame_id);
            self.cells.take(keyframe);
            out.show(CELLS, &self.cells.draw(stamp_ns));
        } else if let Some(correction) = entry.decode::<MapperCorrection>()? {
            self.correction = Some(*correction.head);
        } else if let Some(page) = entry.decode::<MapperGraph>()? {
            if self.graph.take(page.as_ref()) {
                self.graph_pace.change();
            }
        } else if let Some(tile) = entry.decode::<MapperGrid>()? {
            self.tiles.take(tile);
            self.grid_pace.change();
        } else if let Some(drop) = entry.decode::<LogDropTopic>()? {
            out.show(MISSING, &of_drop(&drop.head));
        }
        Ok(())
    }

    /// The log is over: what was held back for its size is shown as it is at last.
    pub fn finish(&mut self, label: RecordHeader, out: &mut Vec<Shown>) {
        let mut out = Out { label, shown: out };
        if self.graph_pace.is_behind() {
            self.draw_graph(&mut out);
        }
        if self.grid_pace.is_behind() {
            self.draw_grid(&mut out);
        }
    }

    /// The mounting is written once before there are poses: clouds have a frame from the
    /// beginning.
    fn begin(&mut self, stamp_ns: i64, out: &mut Out<'_>) {
        if !self.has_begun {
            self.has_begun = true;
            out.show(TRANSFORMS, &mounting(&self.robot, stamp_ns));
        }
    }

    fn see_state(&mut self, state: &OdometryState, out: &mut Out<'_>) {
        // A stage that came back sends its last states again.
        if self.newest.is_some_and(|newest| state.id <= newest) {
            return;
        }
        self.newest = Some(state.id);
        self.has_begun = true;
        self.stamp_ns = self.stamp_ns.max(state.header.stamp_ns);
        out.show(POSE, &pose_of_state(state));
        let of_frame = |correction: &&Correction| correction.odom_frame_id == state.odom_frame_id;
        let correction = self.correction.as_ref().filter(of_frame);
        out.show(TRANSFORMS, &transforms(&self.robot, state, correction));
        let now_ns = out.label.time_ns;
        let graph_bytes = self.graph.nodes().count() * NODE_BYTES;
        if self.graph_pace.is_due(now_ns, graph_bytes) {
            self.draw_graph(out);
        }
        let grid_bytes = self
            .tiles
            .size()
            .and_then(|size| usize::try_from(size).ok());
        if grid_bytes.is_some_and(|bytes| self.grid_pace.is_due(now_ns, bytes)) {
            self.draw_grid(out);
        }
    }

    fn draw_graph(&self, out: &mut Out<'_>) {
        out.show(GRAPH, &self.graph.draw(self.stamp_ns));
        out.show(LOOPS, &self.graph.draw_loops(self.stamp_ns));
    }

    fn draw_grid(&self, out: &mut Out<'_>) {
        if let Some(grid) = self.tiles.draw(self.stamp_ns) {
            out.show(GRID, &grid);
        }
    }
}

/// Where messages for viewers go, with the label of the one that they are made of.
struct Out<'a> {
    label: RecordHeader,
    shown: &'a mut Vec<Shown>,
}

impl Out<'_> {
    fn show<T: randt_foxglove_schemas::Encode>(&mut self, view: &'static str, message: &T) {
        let label = self.label;
        let bytes = randt_foxglove_schemas::bytes(message);
        self.shown
            .extend(bytes.map(|bytes| Shown { view, label, bytes }));
    }
}
