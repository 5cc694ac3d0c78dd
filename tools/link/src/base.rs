//! The base's end: the robot's topics on a bus of their own, and a mapper's requests answered.

use crate::cargo::Cargo;
use crate::frame::Position;
use crate::journal::unpack;
use crate::link::{End, is_keyframes};
use crate::newest::NewestTopic;
use crate::peer::{Peer, Received};
use crate::ports::{Output, index_of, open_outputs};
use crate::settings::Settings;
use crate::stream::InStream;
use randt_messages::{Keyframe, MapperGraph, MapperGrid, Message, Topic};
use randt_stage::{Checkpoint, Publisher, Stage, Subscriber, Waitable};
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::time::{Duration, Instant};

/// Keyframes that are kept to be sent once more: more than the bus keeps for a mapper that comes.
const KEPT: usize = 64;
/// A request that is repeated is taken for the same one for this time: the link may be slow.
const PATIENCE: Duration = Duration::from_secs(30);
/// Tiles that a new reader gets at once, and how often.
const TILES: usize = 16;
const TILES_EVERY: Duration = Duration::from_millis(100);
/// Bytes of a position on the disk.
const POSITION: usize = 16;

/// The base's end.
pub struct Base {
    outputs: Vec<Box<dyn Output>>,
    keyframes: Option<Keyframes>,
    graphs: Option<Subscriber<MapperGraph>>,
    graph_topic: u8,
    tiles: Tiles,
    /// Messages of the robot's that cannot be read.
    broken: u64,
}

/// The robot's keyframes on their way to this bus.
struct Keyframes {
    topic: u8,
    publisher: Publisher<Keyframe>,
    position: Checkpoint,
    kept: VecDeque<Message<Keyframe>>,
    /// The request that was passed on to the robot, and when.
    asked: Option<(u64, Instant)>,
}

/// The grid, for readers that come later.
struct Tiles {
    topic: Option<u8>,
    /// How far the keyframes are.
    followed: Option<Position>,
    /// By their key, each with its stamp.
    tiles: BTreeMap<u64, (i64, Vec<u8>)>,
    to_send: VecDeque<u64>,
    next: Instant,
}

impl Base {
    /// Opens the topics.
    pub fn open(
        stage: &mut Stage,
        settings: &Settings,
        cargo: &mut Cargo,
    ) -> Result<Self, Box<dyn Error>> {
        let mut keyframes = None;
        let mut topics = Vec::new();
        for carried in &settings.up {
            if is_keyframes(carried) {
                let (opened, wanted) = Keyframes::open(stage, carried.topic)?;
                cargo.incoming.push(InStream::new(carried.topic, wanted));
                keyframes = Some(opened);
                continue;
            }
            topics.push(carried.topic);
            if carried.is_every {
                cargo.incoming.push(InStream::new(carried.topic, None));
            }
        }
        let graph_topic = index_of(MapperGraph::NAME).unwrap_or_default();
        let graphs = match settings.is_mapper_at_base {
            true => {
                cargo.newest.push(NewestTopic::new(graph_topic, true, 0.0));
                Some(stage.subscriber()?)
            }
            false => None,
        };
        Ok(Self {
            outputs: open_outputs(stage, &topics)?,
            keyframes,
            graphs,
            graph_topic,
            tiles: Tiles {
                topic: index_of(MapperGrid::NAME),
                followed: None,
                tiles: BTreeMap::new(),
                to_send: VecDeque::new(),
                next: Instant::now(),
            },
            broken: 0,
        })
    }

    /// What the mapper here says: where it is goes to the robot, what it lacks it gets.
    fn hear_mapper(&mut self, peer: &mut Peer) -> Result<(), randt_stage::Error> {
        let Some(graphs) = &mut self.graphs else {
            return Ok(());
        };
        let mut wanted = None;
        while let Some(received) = graphs.receive()? {
            let message = received.message();
            if !message.items.is_empty() {
                continue;
            }
            // The last word counts: this process may just have come, and read old ones.
            wanted = (message.head.send_again == 1).then_some(message.head.wanted_keyframe);
            let mut bytes = Vec::new();
            message.write_bytes(&mut bytes);
            let mut topics = peer.cargo.newest.iter_mut();
            if let Some(topic) = topics.find(|topic| topic.topic == self.graph_topic) {
                topic.push(0, message.header().stamp_ns, bytes);
            }
        }
        match (wanted, &mut self.keyframes) {
            (Some(wanted), Some(keyframes)) => keyframes.answer(wanted, peer),
            _ => Ok(()),
        }
    }
}

impl End for Base {
    fn deliver(&mut self, received: Received, _: &mut Peer) -> Result<(), Box<dyn Error>> {
        if let Some(keyframes) = &mut self.keyframes
            && keyframes.topic == received.topic
        {
            if !keyframes.publish(&received)? {
                self.broken += 1;
            }
            if let Some(next) = received.next {
                self.tiles.follow(next);
            }
            return Ok(());
        }
        let outputs = self.outputs.iter_mut();
        for output in outputs.filter(|output| output.topic() == received.topic) {
            if !output.publish(&received.message)? {
                self.broken += 1;
            }
        }
        if self.tiles.topic == Some(received.topic)
            && let Some(key) = received.key
            && let Some(tile) = Message::<MapperGrid>::from_bytes(&received.message)
        {
            let stamp_ns = tile.head.header.stamp_ns;
            self.tiles.tiles.insert(key, (stamp_ns, received.message));
        }
        Ok(())
    }

    fn turn(&mut self, peer: &mut Peer) -> Result<(), Box<dyn Error>> {
        self.hear_mapper(peer)?;
        let topic = self.tiles.topic;
        let outputs = self.outputs.iter_mut();
        for output in outputs.filter(|output| Some(output.topic()) == topic) {
            self.tiles.turn(output.as_mut())?;
        }
        Ok(())
    }

    fn waitables(&self) -> Vec<&dyn Waitable> {
        let graphs = self.graphs.iter();
        graphs.map(|graphs| graphs as &dyn Waitable).collect()
    }

    fn pause(&self) -> Duration {
        match self.tiles.to_send.is_empty() {
            true => Duration::MAX,
            false => self.tiles.next.saturating_duration_since(Instant::now()),
        }
    }

    fn problem(&self, peer: &Peer) -> (String, u64) {
        let incoming = peer.cargo.incoming.iter();
        let lost = incoming.map(|stream| stream.lost).sum::<u64>();
        let text = match (lost, self.broken) {
            (0, 0) => String::new(),
            (lost, 0) => format!("{lost} messages were gone at the robot before they came"),
            (_, broken) => format!("{broken} messages of the robot cannot be read"),
        };
        (text, lost + self.broken)
    }

    fn take_news(&mut self) -> Vec<String> {
        Vec::new()
    }
}

impl Keyframes {
    /// Opens the topic; gives where to go on.
    fn open(stage: &mut Stage, topic: u8) -> Result<(Self, Option<Position>), randt_stage::Error> {
        let path = stage.domain().state().join("link.position");
        let position = Checkpoint::open(&path, POSITION)?;
        let newest = position.versions().into_iter().next();
        let wanted = newest.and_then(|bytes| {
            let (series, rest) = bytes.split_first_chunk()?;
            Some(Position {
                series: i64::from_le_bytes(*series),
                id: u64::from_le_bytes(*rest.first_chunk()?),
                offset: 0,
            })
        });
        let keyframes = Self {
            topic,
            publisher: stage.publisher()?,
            position,
            kept: VecDeque::new(),
            asked: None,
        };
        Ok((keyframes, wanted))
    }

    /// Publishes a keyframe; `false` where it is none.
    fn publish(&mut self, received: &Received) -> Result<bool, randt_stage::Error> {
        let Some(keyframe) = unpack(&received.message) else {
            return Ok(false);
        };
        self.publisher.publish(keyframe.as_ref())?;
        let is_next = |last: &Message<Keyframe>| last.head.id + 1 == keyframe.head.id;
        if !self.kept.back().is_some_and(is_next) {
            // A step back, or another drive.
            self.kept.clear();
        }
        self.kept.push_back(keyframe);
        if self.kept.len() > KEPT {
            self.kept.pop_front();
        }
        if let Some(next) = received.next {
            self.store(next);
        }
        Ok(true)
    }

    /// Keeps where to go on. What is sent twice the mapper drops; what it lacks it asks for.
    fn store(&mut self, next: Position) {
        let _ = self.position.write(|slot| {
            let bytes = next
                .series
                .to_le_bytes()
                .into_iter()
                .chain(next.id.to_le_bytes());
            slot.iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte);
            Ok::<usize, ()>(POSITION)
        });
    }

    /// The mapper lacks keyframes from a number on. The one before goes with them: it shows the
    /// mapper whether both are of the same drive.
    fn answer(&mut self, wanted: u64, peer: &mut Peer) -> Result<(), randt_stage::Error> {
        let from = wanted.saturating_sub(1);
        if self.kept.front().is_some_and(|first| first.head.id <= from)
            && self.kept.back().is_some_and(|last| last.head.id >= from)
        {
            for keyframe in self.kept.iter().filter(|it| it.head.id >= from) {
                self.publisher.publish(keyframe.as_ref())?;
            }
            return Ok(());
        }
        let topic = self.topic;
        let mut incoming = peer.cargo.incoming.iter_mut();
        let Some(stream) = incoming.find(|stream| stream.topic == topic) else {
            return Ok(());
        };
        let is_asked = self
            .asked
            .is_some_and(|(id, when)| id == from && when.elapsed() < PATIENCE);
        // What is under way is ahead, and would count as an answer: it is not taken any more.
        if !is_asked && stream.wanted().id > from {
            stream.go_back(from);
            self.asked = Some((from, Instant::now()));
        }
        Ok(())
    }
}

impl Tiles {
    /// A keyframe came. Where it begins another drive the map so far is void. A drive whose
    /// numbers go on has lost the link's journal, and has its map.
    fn follow(&mut self, next: Position) {
        let before = self.followed.replace(next);
        let is_other = |it: Position| it.series != next.series && next.id <= it.id;
        if before.is_some_and(is_other) {
            let is_new = |_: &u64, (stamp_ns, _): &mut (i64, Vec<u8>)| *stamp_ns >= next.series;
            self.tiles.retain(is_new);
        }
    }

    fn turn(&mut self, output: &mut dyn Output) -> Result<(), randt_stage::Error> {
        if output.has_new_reader() {
            self.to_send = self.tiles.keys().copied().collect();
        }
        if self.to_send.is_empty() || Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + TILES_EVERY;
        for _ in 0..TILES {
            let key = self.to_send.pop_front();
            if let Some((_, tile)) = key.and_then(|key| self.tiles.get(&key)) {
                output.publish(tile)?;
            }
        }
        Ok(())
    }
}
