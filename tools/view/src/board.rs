//! What there is to show: of everything the newest.

use randt_config::{Config, Robot};
use randt_foxglove_schemas::tile::{Detail, of_tile};
use randt_foxglove_schemas::{Graph, SceneUpdate, SubmapCells, ViewerTopic};
use randt_geometry::Pose2;
use randt_messages::{
    Correction, Keyframe, MapperGraph, MapperGrid, Message, MessageRef, OdometryState, RadarPoints,
};
use std::collections::{BTreeMap, VecDeque};

/// Their rate is taken over this many poses.
const RATE_OVER: usize = 10;
/// A stamp that is older than this when its message is published is of another clock: a
/// recording's.
const OTHER_CLOCK_NS: i64 = 10_000_000_000;

/// A scene entity: sent when it changes, and kept by the viewer by its name. A quarter of a tile,
/// or a part of the path.
#[derive(Debug)]
pub(crate) struct Entity {
    /// Rises with every change of any entity.
    pub version: u64,
    /// The message.
    pub bytes: Vec<u8>,
    /// The same with less detail, where there is one.
    pub coarse: Option<Vec<u8>>,
    /// Its middle in `map`, m; none for the path.
    pub position_m: Option<[f64; 2]>,
}

/// The newest of everything.
#[derive(Debug, Default)]
pub struct Board {
    pub(crate) robot: Robot,
    /// The newest state, and how many there were.
    pub(crate) state: Option<OdometryState>,
    pub(crate) states: u64,
    /// When the last ones were published, ns.
    published_ns: VecDeque<i64>,
    pub(crate) correction: Option<Correction>,
    /// The newest cloud, and how many there were.
    pub(crate) points: Option<Message<RadarPoints>>,
    pub(crate) clouds: u64,
    graph: Graph,
    /// Odometry's submap, and when it was drawn, ns; none where it is not followed.
    cells: Option<(SubmapCells, i64)>,
    /// By channel and name.
    pub(crate) entities: BTreeMap<(ViewerTopic, String), Entity>,
    /// Number of the newest change of an entity.
    pub(crate) version: u64,
    /// How often the map began anew.
    pub(crate) maps: u64,
}

impl Board {
    /// Nothing yet, of a robot.
    pub fn new(config: &Config) -> Self {
        Self {
            robot: config.robot.clone(),
            cells: Some((SubmapCells::new(config), 0)),
            ..Self::default()
        }
    }

    /// A pose.
    pub fn take_state(&mut self, state: &OdometryState) {
        let is_other = |known: OdometryState| known.header.epoch != state.header.epoch;
        if self.state.is_some_and(is_other) {
            self.published_ns.clear();
        }
        if self.published_ns.len() == RATE_OVER {
            self.published_ns.pop_front();
        }
        self.published_ns.push_back(state.header.published_ns);
        self.state = Some(*state);
        self.states += 1;
    }

    /// Where `odom` lies in `map`.
    pub fn take_correction(&mut self, correction: &Correction) {
        let known = self.correction.replace(*correction);
        if known.is_some_and(|known| known.graph_version > correction.graph_version) {
            // Another drive: the map is void.
            self.entities.clear();
            self.graph = Graph::default();
            self.maps += 1;
        }
    }

    /// Filtered returns.
    pub fn take_points(&mut self, message: MessageRef<'_, RadarPoints>) {
        let points = self.points.get_or_insert_default();
        *points.head = *message.head;
        points.items.clear();
        points.items.extend_from_slice(message.items);
        self.clouds += 1;
    }

    /// A tile as it now is.
    pub fn take_tile(&mut self, message: MessageRef<'_, MapperGrid>) {
        let [fine, coarse] = [Detail::Fine, Detail::Coarse].map(|detail| of_tile(message, detail));
        for (fine, coarse) in fine.into_iter().zip(coarse) {
            let key = (ViewerTopic::Grid, fine.name);
            // What was never known need not be removed.
            if let Some(bytes) = randt_foxglove_schemas::bytes(&fine.update)
                && (!fine.is_empty || self.entities.contains_key(&key))
            {
                let coarse = randt_foxglove_schemas::bytes(&coarse.update);
                self.put(key, Some(fine.middle_m), bytes, coarse);
            }
        }
    }

    /// A page of the pose graph.
    pub fn take_graph(&mut self, page: MessageRef<'_, MapperGraph>) {
        if !self.graph.take(page) {
            return;
        }
        let entities = randt_foxglove_schemas::graph_entities(&self.graph);
        let is_there = |name: &String| entities.iter().any(|(there, _)| there == name);
        let known = self.entities.keys();
        let known = known.filter(|(topic, _)| *topic == ViewerTopic::Path);
        let gone = known.map(|(_, name)| name).filter(|name| !is_there(name));
        let gone: Vec<String> = gone.cloned().collect();
        for name in gone {
            // Drawn empty, so that viewers remove it.
            self.draw(randt_foxglove_schemas::empty_entity(&name), name);
        }
        for (name, update) in entities {
            self.draw(update, name);
        }
    }

    /// A keyframe, which becomes part of the submap.
    pub fn take_keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        let header = keyframe.head.header;
        let Some((cells, drawn_ns)) = &mut self.cells else {
            return;
        };
        cells.take(Message {
            head: Box::new(*keyframe.head),
            items: keyframe.items.to_vec(),
        });
        let topic = ViewerTopic::Cells;
        let pause_ns = topic.live_period_ns();
        if (0..pause_ns).contains(&(header.published_ns - *drawn_ns)) {
            return;
        }
        *drawn_ns = header.published_ns;
        let update = cells.draw(header.stamp_ns);
        if let Some(bytes) = randt_foxglove_schemas::bytes(&update) {
            self.put((topic, "cells".to_owned()), None, bytes, None);
        }
    }

    fn draw(&mut self, update: SceneUpdate, name: String) {
        if let Some(bytes) = randt_foxglove_schemas::bytes(&update) {
            self.put((ViewerTopic::Path, name), None, bytes, None);
        }
    }

    fn put(
        &mut self,
        key: (ViewerTopic, String),
        position_m: Option<[f64; 2]>,
        bytes: Vec<u8>,
        coarse: Option<Vec<u8>>,
    ) {
        let known = self.entities.get(&key);
        if known.is_some_and(|known| known.bytes == bytes) {
            return;
        }
        self.version += 1;
        let entity = Entity {
            version: self.version,
            bytes,
            coarse,
            position_m,
        };
        self.entities.insert(key, entity);
    }

    /// Where the robot is in `map`, m, as far as is known.
    pub(crate) fn robot_m(&self) -> [f64; 2] {
        let pose = self.state.map_or([0.0; 3], |state| state.pose);
        let odom = self.correction.map_or([0.0; 3], |it| it.map_from_odom);
        let at = Pose2::from_array(odom).compose(&Pose2::from_array(pose));
        [at.x_m, at.y_m]
    }

    /// How old the newest pose is, s; `None` before there is one.
    pub(crate) fn age_s(&self, now_ns: i64) -> Option<f64> {
        let header = self.state?.header;
        let late_ns = header.published_ns.saturating_sub(header.stamp_ns);
        let measured_ns = match (0..OTHER_CLOCK_NS).contains(&late_ns) {
            true => header.stamp_ns,
            false => header.published_ns,
        };
        Some(now_ns.saturating_sub(measured_ns).max(0) as f64 * 1e-9)
    }

    /// The data's time: that of their stamps, which in a recording is not ours.
    pub(crate) fn time_ns(&self, now_ns: i64) -> i64 {
        self.state.map_or(now_ns, |state| {
            let since_ns = now_ns.saturating_sub(state.header.published_ns).max(0);
            state.header.stamp_ns.saturating_add(since_ns)
        })
    }

    /// Poses a second.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let (first, last) = (self.published_ns.front()?, self.published_ns.back()?);
        let steps = self.published_ns.len() - 1;
        (last > first).then(|| steps as f64 / ((last - first) as f64 * 1e-9))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::TILE_CELLS;

    fn state(published_ns: i64) -> OdometryState {
        let mut state = OdometryState::default();
        state.header.published_ns = published_ns;
        state.header.stamp_ns = 7_000_000_000;
        state
    }

    #[test]
    fn age_and_time_are_right_for_a_recording_too() {
        let mut board = Board::new(&Config::default());
        assert_eq!((board.age_s(5), board.rate_hz()), (None, None));
        for i in 0..20 {
            board.take_state(&state(1_000_000_000_000 + i * 200_000_000));
        }
        let now_ns = 1_000_000_000_000 + 19 * 200_000_000 + 500_000_000;
        assert_eq!(board.age_s(now_ns), Some(0.5));
        assert_eq!(board.time_ns(now_ns), 7_500_000_000);
        assert!((board.rate_hz().unwrap() - 5.0).abs() < 1e-9);
        // Live, the age is that of what was measured.
        board.take_state(&state(7_100_000_000));
        assert!((board.age_s(7_300_000_000).unwrap() - 0.3).abs() < 1e-9);
    }

    #[test]
    fn the_cells_of_the_submap_are_drawn_again_after_a_while() {
        let mut board = Board::new(&Config::default());
        let mut version_after = |id: u64, published_s: i64| {
            let mut keyframe = Message::<Keyframe>::default();
            keyframe.head.id = id;
            keyframe.head.header.published_ns = published_s * 1_000_000_000;
            keyframe.head.header.stamp_ns = keyframe.head.header.published_ns;
            board.take_keyframe(keyframe.as_ref());
            board.version
        };
        let versions = [(0, 100), (1, 102), (2, 106)].map(|(id, s)| version_after(id, s));
        assert_eq!(versions, [1, 1, 2]);
    }

    #[test]
    fn a_tile_is_sent_only_where_it_differs_and_another_drive_has_no_tile() {
        let mut board = Board::new(&Config::default());
        let mut tile = Message::<MapperGrid> {
            items: vec![0; TILE_CELLS * TILE_CELLS],
            ..Message::default()
        };
        board.take_tile(tile.as_ref());
        tile.head.header.stamp_ns = 1_000_000_000;
        board.take_tile(tile.as_ref());
        assert_eq!(board.version, 4);
        tile.items[0] = 100;
        board.take_tile(tile.as_ref());
        assert_eq!(
            (board.version, board.entities.len()),
            (5, 4),
            "a quarter of it"
        );
        (tile.head.row, tile.items) = (9, vec![255; TILE_CELLS * TILE_CELLS]);
        board.take_tile(tile.as_ref());
        assert_eq!(board.entities.len(), 4, "never known, never shown");
        let mut correction = Correction {
            graph_version: 5,
            ..Correction::default()
        };
        board.take_correction(&correction);
        assert_eq!(board.entities.len(), 4);
        correction.graph_version = 1;
        board.take_correction(&correction);
        assert_eq!((board.entities.len(), board.maps), (0, 1));
    }
}
