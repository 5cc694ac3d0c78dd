//! Messages of a running ROS, as they come: decoded and judged as those of a bag.

use super::recording::{Channel, Kind, RadarKind, Raw, Recording};
use super::wire::Encoding;
use super::{RosSource, decode_transforms};
use crate::{Counter, Error, Event, Extrinsics, Options, Source, counters::Counters};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::Path;
use std::rc::Rc;

/// Messages of a radar from which its turn is learned before the first sweep is given out: 8
/// sweeps, or of a radar that sends its azimuths one by one 8 turns.
const LEARN_MESSAGES: usize = 8;
const AZIMUTHS: usize = 400;
/// Most messages that wait meanwhile: of IMU samples over a minute at 250 Hz.
const WAITING_MAX: usize = 20_000;
/// Messages of static transforms that are kept; a robot has one for each publisher.
const TRANSFORMS_MAX: usize = 1000;
/// What stands for a file in texts.
const NAME: &str = "ROS";

/// A message that waits: its channel, when it came, and its bytes.
type Waiting = (usize, i64, Vec<u8>);

/// The topics of a running ROS as sweeps, IMU samples and twists.
///
/// What a bag says as a whole, the radar's turn and the mounting, is learned from the first sweeps,
/// and once more where a topic or a static transform comes that was not known.
pub struct LiveRos {
    encoding: Encoding,
    options: Options,
    channels: Vec<Channel>,
    transforms: Vec<Vec<u8>>,
    waiting: Rc<RefCell<VecDeque<Waiting>>>,
    /// Sweeps, or azimuths, that wait.
    radar_waiting: usize,
    source: Option<RosSource>,
    /// What was counted by sources of before.
    counters: Counters,
}

impl LiveRos {
    /// Nothing has come yet. `encoding`: how the messages are serialised.
    pub fn new(encoding: Encoding, options: Options) -> Self {
        Self {
            encoding,
            options,
            channels: Vec::new(),
            transforms: Vec::new(),
            waiting: Rc::default(),
            radar_waiting: 0,
            source: None,
            counters: Counters::default(),
        }
    }

    /// Takes a message of a topic, as ROS serialises it. Types that say nothing of a radar, an
    /// IMU or a velocity are left out.
    pub fn push(&mut self, topic: &str, type_name: &str, arrival_ns: i64, bytes: Vec<u8>) {
        let kind = Kind::from_topic(topic, type_name);
        if self.is_misnamed(topic, kind) {
            let first = || format!("{topic} is {type_name}, which is not what it is named for");
            self.counters
                .count_loss("messages_of_another_type", 1, first);
            return;
        }
        match kind {
            Kind::Other => return,
            // They are read for what never changes.
            Kind::Transforms if self.source.is_some() => return,
            Kind::StaticTransforms => return self.learn_transform(bytes),
            _ => {}
        }
        let same = |channel: &Channel| channel.topic == topic && channel.type_name == type_name;
        let index = self.channels.iter().position(same).unwrap_or_else(|| {
            self.forget();
            self.channels.push(Channel {
                topic: topic.to_owned(),
                type_name: type_name.to_owned(),
                kind,
                encoding: self.encoding,
                messages: 1,
            });
            self.channels.len() - 1
        });
        if let Kind::Radar(kind) = kind {
            self.radar_waiting += match kind {
                RadarKind::Fft => 1,
                _ => AZIMUTHS,
            };
        }
        let mut waiting = self.waiting.borrow_mut();
        waiting.push_back((index, arrival_ns, bytes));
        if waiting.len() > WAITING_MAX {
            waiting.pop_front();
            let first = || format!("{NAME}: no radar came with {WAITING_MAX} other messages");
            self.counters.count_loss("messages_dropped", 1, first);
        }
    }

    /// The next event; `None` until more has come.
    pub fn next_event(&mut self) -> Result<Option<Event>, Error> {
        if self.source.is_none() {
            if self.radar_waiting < LEARN_MESSAGES * AZIMUTHS {
                return Ok(None);
            }
            self.radar_waiting = 0;
            let queue = Queue {
                encoding: self.encoding,
                channels: self.channels.clone(),
                transforms: self.transforms.clone(),
                waiting: Rc::clone(&self.waiting),
                present: Vec::new(),
            };
            let path = Path::new(NAME);
            let options = self.options_so_far();
            let source = RosSource::open(Box::new(queue), Vec::new(), path, &options)?;
            if source.has_learned() {
                self.source = Some(source);
            } else {
                self.counters.add_all(source.counters());
            }
        }
        match &mut self.source {
            Some(source) => source.next_event(),
            None => Ok(None),
        }
    }

    /// Whether an option names a topic for what its type does not hold.
    fn is_misnamed(&self, topic: &str, kind: Kind) -> bool {
        let named = |option: &Option<String>| option.as_deref() == Some(topic);
        named(&self.options.radar_topic) && !matches!(kind, Kind::Radar(_))
            || named(&self.options.imu_topic) && kind != Kind::Imu
            || named(&self.options.twist_topic) && !matches!(kind, Kind::Twist(_))
    }

    /// The options without topics of which nothing has come: they are learned when they come.
    fn options_so_far(&self) -> Options {
        let mut options = self.options.clone();
        for topic in [&mut options.imu_topic, &mut options.twist_topic] {
            let name = topic.as_deref().unwrap_or_default();
            if !self.channels.iter().any(|channel| channel.topic == name) {
                *topic = None;
            }
        }
        options
    }

    /// Where ROS says that the sensors sit, once it is learned.
    pub fn extrinsics(&self) -> Option<Extrinsics> {
        self.source.as_ref().map(|source| source.info().extrinsics)
    }

    /// What was dropped, repaired or assumed so far.
    pub fn counters(&self) -> Vec<Counter> {
        let mut counters = self.counters.clone();
        if let Some(source) = &self.source {
            counters.add_all(source.counters());
        }
        counters.list()
    }

    fn learn_transform(&mut self, bytes: Vec<u8>) {
        if self.transforms.contains(&bytes) || self.transforms.len() >= TRANSFORMS_MAX {
            return;
        }
        if let Err(malformed) = decode_transforms(&bytes, self.encoding) {
            let first = || format!("{NAME}: {malformed}");
            self.counters.count_loss("transforms_malformed", 1, first);
            return;
        }
        self.forget();
        self.transforms.push(bytes);
    }

    /// What comes next is learned from anew.
    fn forget(&mut self) {
        if let Some(source) = self.source.take() {
            self.counters.add_all(source.counters());
        }
    }
}

/// What has come and is not read yet, as a recording.
struct Queue {
    encoding: Encoding,
    channels: Vec<Channel>,
    transforms: Vec<Vec<u8>>,
    waiting: Rc<RefCell<VecDeque<Waiting>>>,
    present: Vec<u8>,
}

impl Recording for Queue {
    fn format(&self) -> &'static str {
        match self.encoding {
            Encoding::Ros1 => "ros1",
            Encoding::Cdr => "ros2",
        }
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn next_message(&mut self, _counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        let Some((channel, arrival_ns, bytes)) = self.waiting.borrow_mut().pop_front() else {
            return Ok(None);
        };
        self.present = bytes;
        Ok(Some(Raw {
            channel,
            arrival_ns,
            offset: 0,
            bytes: &self.present,
        }))
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn is_live(&self) -> bool {
        true
    }
}
