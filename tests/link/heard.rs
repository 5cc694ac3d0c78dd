//! What a bus has, and what a map that was made of it must be.

use crate::support::pipeline::{Pipeline, until};
use randt_config::Config;
use randt_mapper::Mapper;
use randt_mapper::publication::fill_graph;
use randt_messages::{
    GraphEntry, GraphEntryKind, Header, Keyframe, MapperCorrection, MapperGraph, MapperGrid,
    Message, OdometryState, OdometryStateTopic, StageHealth, StageHealthTopic, health::text_of,
};
use randt_stage::{Observer, Subscriber};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// What a bus has: the fields are a subscriber of each topic and what it brought.
pub struct Heard {
    pub observer: Observer,
    pub anchor_ns: i64,
    pub states: Subscriber<OdometryStateTopic>,
    pub keyframes: Subscriber<Keyframe>,
    pub corrections: Subscriber<MapperCorrection>,
    pub graphs: Subscriber<MapperGraph>,
    pub tiles: Subscriber<MapperGrid>,
    pub health: Subscriber<StageHealthTopic>,
    /// By number.
    pub state: BTreeMap<u64, OdometryState>,
    pub keyframe: BTreeMap<u64, Message<Keyframe>>,
    /// Numbers in the order in which they came.
    pub order: Vec<u64>,
    pub correction: Option<randt_messages::Correction>,
    pub graph: Option<randt_messages::GraphHead>,
    /// Nodes of the whole graph, as its pages came last.
    pub nodes: BTreeMap<u64, [f64; 3]>,
    pub tile: BTreeMap<(i32, i32), Vec<u8>>,
    pub stages: BTreeMap<String, StageHealth>,
    /// When each state, health and correction came: topic, what tells it, the robot's stamp of its
    /// publishing or zero, and when it was published here, all by the clock since the boot, ns.
    pub came: Vec<(&'static str, u64, i64, i64)>,
}

impl Heard {
    pub fn enter(pipeline: &Pipeline) -> Self {
        let observer = Observer::enter(pipeline.domain()).unwrap().unwrap();
        Self {
            anchor_ns: observer.clock().anchor_ns(),
            states: observer.subscriber().unwrap(),
            keyframes: observer.subscriber().unwrap(),
            corrections: observer.subscriber().unwrap(),
            graphs: observer.subscriber().unwrap(),
            tiles: observer.subscriber().unwrap(),
            health: observer.subscriber().unwrap(),
            observer,
            state: BTreeMap::new(),
            keyframe: BTreeMap::new(),
            order: Vec::new(),
            correction: None,
            graph: None,
            nodes: BTreeMap::new(),
            tile: BTreeMap::new(),
            stages: BTreeMap::new(),
            came: Vec::new(),
        }
    }

    pub fn listen(&mut self) {
        let o = &self.observer;
        let anchor_ns = self.anchor_ns;
        let at_ns = |header: &Header| header.published_ns - anchor_ns;
        o.read(&mut self.states, |message| {
            let head = message.head;
            if self.state.insert(head.id, *head).is_none() {
                self.came.push(("state", head.id, 0, at_ns(&head.header)));
            }
        })
        .unwrap();
        o.read(&mut self.keyframes, |message| {
            let id = message.head.id;
            let mut bytes = Vec::new();
            message.write_bytes(&mut bytes);
            let mut keyframe = Message::<Keyframe>::from_bytes(&bytes).unwrap();
            // The publisher's own.
            let header = &mut keyframe.head.header;
            (header.sequence, header.epoch, header.published_ns) = (0, 0, 0);
            if let Some(before) = self.keyframe.get(&id) {
                assert_eq!(before, &keyframe, "keyframe {id}");
            }
            self.keyframe.insert(id, keyframe);
            self.order.push(id);
        })
        .unwrap();
        o.read(&mut self.corrections, |message| {
            let head = message.head;
            self.correction = Some(*head);
            self.came
                .push(("correction", head.graph_version, 0, at_ns(&head.header)));
        })
        .unwrap();
        o.read(&mut self.graphs, |message| match message.items {
            [] => self.graph = Some(*message.head),
            entries => self.nodes.extend(nodes(entries)),
        })
        .unwrap();
        o.read(&mut self.tiles, |message| {
            let head = message.head;
            self.tile
                .insert((head.column, head.row), message.items.to_vec());
        })
        .unwrap();
        o.read(&mut self.health, |message| {
            let head = message.head;
            let name = text_of(&head.name).to_owned();
            self.came.push((
                "health",
                head.pid,
                head.header.stamp_ns,
                at_ns(&head.header),
            ));
            self.stages.insert(name, *head);
        })
        .unwrap();
    }
}

/// Listens to both until something holds.
pub fn listen_until(what: &str, both: &mut [Heard; 2], mut holds: impl FnMut(&[Heard; 2]) -> bool) {
    until(what, || {
        both.iter_mut().for_each(Heard::listen);
        std::thread::sleep(Duration::from_millis(20));
        holds(both)
    });
}

/// Nodes of a graph by their number.
pub fn nodes(entries: &[GraphEntry]) -> BTreeMap<u64, [f64; 3]> {
    let kind = GraphEntryKind::Node as u32;
    let nodes = entries.iter().filter(|entry| entry.kind == kind);
    nodes.map(|entry| (entry.a, entry.pose)).collect()
}

/// The graph that a mapper on the robot would have made of the keyframes of the link's journal.
pub fn onboard(journal: &Path) -> BTreeMap<u64, [f64; 3]> {
    let bytes = std::fs::read(journal).unwrap();
    let (mapper, restored) = Mapper::restore(&Config::default(), &bytes).unwrap();
    assert_eq!(restored.from_snapshot, 0);
    let mut page = Message::default();
    let mut entries = Vec::new();
    let mut first = Some(0);
    while let Some(from) = first {
        first = fill_graph(&mapper, from, &mut page);
        entries.extend_from_slice(&page.items);
    }
    nodes(&entries)
}

/// Whether the base's mapper has what a mapper on the robot would have.
pub fn check_map(base: &Heard, journal: &Path) {
    let onboard = onboard(journal);
    assert!(onboard.len() > 5);
    assert_eq!(base.nodes.len(), onboard.len());
    for (id, pose) in &onboard {
        let there = base.nodes[id];
        let off = there.iter().zip(pose).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{id}: {there:?}, {pose:?}");
    }
}
