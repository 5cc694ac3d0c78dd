//! The robot's end: its keyframes go by a journal; a mapper at the base is heard on its bus.

use crate::cargo::Cargo;
use crate::journal::Journal;
use crate::link::{End, is_keyframes};
use crate::peer::{Peer, Received};
use crate::ports::{Output, index_of, is_of_map, open_outputs};
use crate::settings::{Carried, Settings};
use crate::stream::{OutStream, Source};
use randt_config::Config;
use randt_messages::{Keyframe, MapperGraph, Message, Topic};
use randt_stage::{KeyframeRing, Publisher, Stage, Subscriber, Waitable};
use std::cell::RefCell;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Most of a journal in the run folder, which is memory, bytes: an hour's keyframes.
const MEMORY_MAX: u64 = 64_000_000;
/// A journal that took none, as on a full disk, is tried again this often.
const AGAIN: Duration = Duration::from_secs(1);
/// What odometry has to know of the mapper is repeated this often, as the mapper does.
const BEAT: Duration = Duration::from_millis(500);

/// The robot's end.
pub struct Robot {
    outputs: Vec<Box<dyn Output>>,
    keyframes: Option<Keyframes>,
    mapper: Option<MapperAtBase>,
}

/// The keyframes on their way into the journal.
struct Keyframes {
    subscriber: Subscriber<Keyframe>,
    journal: Rc<RefCell<Journal>>,
    ring: PathBuf,
    /// Why the journal did not take the last one, and when that is tried again.
    trouble: String,
    again: Instant,
    /// Keyframes that neither came nor were in the ring.
    lost: u64,
}

/// What of a mapper at the base is published here.
struct MapperAtBase {
    graphs: Publisher<MapperGraph>,
    graph: Message<MapperGraph>,
    topic: u8,
    beat: Instant,
}

impl Robot {
    /// Opens topics and journal.
    pub fn open(
        stage: &mut Stage,
        config: &Config,
        settings: &Settings,
        journal: &Path,
        cargo: &mut Cargo,
    ) -> Result<Self, Box<dyn Error>> {
        let keyframes = settings.up.iter().find(|it| is_keyframes(it));
        let keyframes = match keyframes {
            Some(carried) => Some(Keyframes::open(stage, config, journal, carried, cargo)?),
            None => None,
        };
        let graph = index_of(MapperGraph::NAME).filter(|_| settings.is_mapper_at_base);
        let mapper = match graph {
            Some(topic) => Some(MapperAtBase {
                graphs: stage.publisher()?,
                graph: Message::default(),
                topic,
                beat: Instant::now(),
            }),
            None => None,
        };
        let outputs = settings.down.iter().map(|it| it.topic);
        let outputs: Vec<u8> = outputs.filter(|topic| Some(*topic) != graph).collect();
        Ok(Self {
            outputs: open_outputs(stage, &outputs)?,
            keyframes,
            mapper,
        })
    }
}

impl End for Robot {
    fn deliver(&mut self, received: Received, _: &mut Peer) -> Result<(), Box<dyn Error>> {
        if let Some(mapper) = &mut self.mapper
            && mapper.topic == received.topic
        {
            if let Some(graph) = Message::from_bytes(&received.message) {
                mapper.graph = graph;
                mapper.beat = Instant::now();
            }
            return Ok(());
        }
        let outputs = self.outputs.iter_mut();
        for output in outputs.filter(|output| output.topic() == received.topic) {
            output.publish(&received.message)?;
        }
        Ok(())
    }

    fn turn(&mut self, peer: &mut Peer) -> Result<(), Box<dyn Error>> {
        if let Some(keyframes) = &mut self.keyframes {
            let series = keyframes.journal.borrow().series();
            keyframes.turn()?;
            let begun = keyframes.journal.borrow().series();
            if series != 0 && begun != series {
                // Another drive: the map so far is void, and would go to a base that comes later.
                let topics = peer.cargo.newest.iter_mut();
                topics
                    .filter(|it| is_of_map(it.topic))
                    .for_each(|it| it.forget_before(begun));
            }
        }
        if let (Some(mapper), Some(keyframes)) = (&mut self.mapper, &self.keyframes) {
            mapper.turn(&keyframes.journal.borrow())?;
        }
        Ok(())
    }

    fn waitables(&self) -> Vec<&dyn Waitable> {
        let keyframes = self.keyframes.iter();
        keyframes
            .map(|it| &it.subscriber as &dyn Waitable)
            .collect()
    }

    fn pause(&self) -> Duration {
        let mapper = self.mapper.as_ref();
        mapper.map_or(Duration::MAX, |mapper| {
            mapper.beat.saturating_duration_since(Instant::now())
        })
    }

    fn problem(&self, _: &Peer) -> (String, u64) {
        let keyframes = self.keyframes.as_ref();
        keyframes.map_or((String::new(), 0), |it| {
            let gone = it.journal.borrow().lost;
            (it.trouble.clone(), it.lost + gone)
        })
    }

    fn take_news(&mut self) -> Vec<String> {
        let keyframes = self.keyframes.as_ref();
        let news = keyframes.map(|it| std::mem::take(&mut it.journal.borrow_mut().news));
        news.unwrap_or_default()
    }
}

impl Keyframes {
    fn open(
        stage: &mut Stage,
        config: &Config,
        path: &Path,
        carried: &Carried,
        cargo: &mut Cargo,
    ) -> Result<Self, Box<dyn Error>> {
        let subscriber = stage.subscriber()?;
        let bytes_max = bytes_max(config, path.starts_with(stage.domain().state()));
        let journal = Journal::open(path, config, bytes_max)?;
        let journal = Rc::new(RefCell::new(journal));
        let source = journal.clone();
        cargo
            .streams
            .push(OutStream::new(carried.topic, source, carried.rate));
        let mut keyframes = Self {
            subscriber,
            journal,
            ring: stage.domain().state().join(KeyframeRing::FILE),
            trouble: String::new(),
            again: Instant::now(),
            lost: 0,
        };
        // What came while no link was here, and whether the journal is this drive's.
        keyframes.take_from_ring(0, u64::MAX);
        Ok(keyframes)
    }

    /// Takes what has come.
    fn turn(&mut self) -> Result<(), randt_stage::Error> {
        while let Some(received) = self.subscriber.receive()? {
            let keyframe = received.message();
            let id = keyframe.head.id;
            let next = self.journal.borrow().next();
            if id > next {
                self.take_from_ring(next, id);
            }
            let next = self.journal.borrow().next();
            let pushed = self.journal.borrow_mut().push(keyframe);
            if pushed.is_ok() {
                // Those before it are neither here nor in the ring. As long as the disk takes
                // none, all may still come.
                self.lost += id.saturating_sub(next);
            }
            self.set_trouble(pushed);
        }
        if !self.trouble.is_empty() && Instant::now() >= self.again {
            // Also of a robot that stands: no keyframe follows that would bring the others.
            self.again = Instant::now() + AGAIN;
            let next = self.journal.borrow().next();
            self.take_from_ring(next, u64::MAX);
        }
        Ok(())
    }

    /// Takes keyframes out of odometry's ring, as far as they are there.
    fn take_from_ring(&mut self, from: u64, to: u64) {
        for keyframe in KeyframeRing::read(&self.ring, from, to) {
            let pushed = self.journal.borrow_mut().push(keyframe.as_ref());
            self.set_trouble(pushed);
            if !self.trouble.is_empty() {
                return;
            }
        }
    }

    fn set_trouble(&mut self, pushed: anyhow::Result<()>) {
        self.trouble = match pushed {
            Ok(()) => String::new(),
            Err(why) => format!("the link's journal: {why:#}"),
        };
    }
}

/// Most of the journal, bytes.
fn bytes_max(config: &Config, is_in_memory: bool) -> u64 {
    let bytes = (config.link.journal_max_mb * 1e6) as u64;
    match is_in_memory {
        true => bytes.min(MEMORY_MAX),
        false => bytes,
    }
}

impl MapperAtBase {
    /// Tells odometry, as a mapper here would, where to go on with its numbers. What the mapper
    /// lacks it asks of the base's end, and that one of this one's journal.
    fn turn(&mut self, journal: &Journal) -> Result<(), randt_stage::Error> {
        if Instant::now() < self.beat {
            return Ok(());
        }
        self.beat = Instant::now() + BEAT;
        let head = &mut *self.graph.head;
        head.wanted_keyframe = journal.next();
        head.odom_frame_id = journal.odom_frame_id();
        head.send_again = 0;
        self.graphs.publish(self.graph.as_ref())
    }
}
