//! Topics of this machine's bus, by their names: what is read for the other end, and what of it is
//! published here.

use crate::frame::fnv;
use randt_messages::{
    BUS_TOPICS, GraphHead, MapperGraph, MapperGrid, Message, MessageRef, StageHealth, TileHead,
    Topic, TopicVisitor, visit_bus_topics,
};
use randt_stage::{Error, Publisher, Stage, Subscriber, Waitable};

/// The index of a topic among all of the bus's.
pub fn index_of(name: &str) -> Option<u8> {
    let found = BUS_TOPICS.iter().position(|topic| topic.name == name);
    found.map(|index| index as u8)
}

/// Whether a topic is a map's, which another drive's map replaces as a whole.
pub fn is_of_map(topic: u8) -> bool {
    let names = [MapperGraph::NAME, MapperGrid::NAME];
    names.iter().any(|name| index_of(name) == Some(topic))
}

/// A message that was read.
pub struct Read {
    /// Of each key the newest counts.
    pub key: u64,
    pub stamp_ns: i64,
    pub bytes: Vec<u8>,
}

/// A topic that is read.
pub trait Input {
    fn topic(&self) -> u8;
    /// The next message.
    fn receive(&mut self) -> Result<Option<Read>, Error>;
    fn waitable(&self) -> &dyn Waitable;
    /// Messages that it missed.
    fn missed(&self) -> u64;
}

/// A topic that is published.
pub trait Output {
    fn topic(&self) -> u8;
    /// Publishes bytes; `false` where they are no message.
    fn publish(&mut self, bytes: &[u8]) -> Result<bool, Error>;
    /// Whether a reader has come since the last call.
    fn has_new_reader(&mut self) -> bool;
}

struct TopicInput<T: Topic>(u8, Subscriber<T>);

impl<T: Topic> Input for TopicInput<T> {
    fn topic(&self) -> u8 {
        self.0
    }

    fn receive(&mut self) -> Result<Option<Read>, Error> {
        let Some(received) = self.1.receive()? else {
            return Ok(None);
        };
        let message = received.message();
        let mut bytes = Vec::new();
        message.write_bytes(&mut bytes);
        Ok(Some(Read {
            key: key(message),
            stamp_ns: message.header().stamp_ns,
            bytes,
        }))
    }

    fn waitable(&self) -> &dyn Waitable {
        &self.1
    }

    fn missed(&self) -> u64 {
        self.1.missed()
    }
}

struct TopicOutput<T: Topic>(u8, Publisher<T>);

impl<T: Topic> Output for TopicOutput<T> {
    fn topic(&self) -> u8 {
        self.0
    }

    fn publish(&mut self, bytes: &[u8]) -> Result<bool, Error> {
        let Some(message) = Message::<T>::from_bytes(bytes) else {
            return Ok(false);
        };
        self.1.publish(message.as_ref())?;
        Ok(true)
    }

    fn has_new_reader(&mut self) -> bool {
        self.1.has_new_reader()
    }
}

/// Under which key a message is the newest: a stage, a tile, a page; else the topic has one key.
fn key<T: Topic>(message: MessageRef<'_, T>) -> u64 {
    let head: &dyn std::any::Any = message.head;
    if let Some(health) = head.downcast_ref::<StageHealth>() {
        return fnv(health.name.iter().copied());
    }
    if let Some(tile) = head.downcast_ref::<TileHead>() {
        return u64::from(tile.column as u32) << 32 | u64::from(tile.row as u32);
    }
    if let Some(graph) = head.downcast_ref::<GraphHead>() {
        // Where the mapper is comes twice a second, without entries; the graph in pages.
        let has_entries = !message.items.is_empty();
        return u64::from(graph.first_entry) << 1 | u64::from(has_entries);
    }
    0
}

/// Opens one topic, whichever it is.
struct Opener<'a> {
    stage: &'a mut Stage,
    index: u8,
    wanted: u8,
    input: Option<Box<dyn Input>>,
    output: Option<Box<dyn Output>>,
    is_output: bool,
}

impl TopicVisitor for Opener<'_> {
    type Error = Error;

    fn visit<T: Topic>(&mut self) -> Result<(), Error> {
        if self.index == self.wanted {
            let index = self.index;
            if self.is_output {
                self.output = Some(Box::new(TopicOutput::<T>(index, self.stage.publisher()?)));
            } else {
                self.input = Some(Box::new(TopicInput::<T>(index, self.stage.subscriber()?)));
            }
        }
        self.index += 1;
        Ok(())
    }
}

impl<'a> Opener<'a> {
    fn open(stage: &'a mut Stage, wanted: u8, is_output: bool) -> Result<Self, Error> {
        let mut opener = Self {
            stage,
            index: 0,
            wanted,
            input: None,
            output: None,
            is_output,
        };
        visit_bus_topics(&mut opener)?;
        Ok(opener)
    }
}

/// Opens topics for reading.
pub fn open_inputs(stage: &mut Stage, topics: &[u8]) -> Result<Vec<Box<dyn Input>>, Error> {
    let mut inputs = Vec::new();
    for topic in topics {
        inputs.extend(Opener::open(stage, *topic, false)?.input);
    }
    Ok(inputs)
}

/// Opens topics for writing.
pub fn open_outputs(stage: &mut Stage, topics: &[u8]) -> Result<Vec<Box<dyn Output>>, Error> {
    let mut outputs = Vec::new();
    for topic in topics {
        outputs.extend(Opener::open(stage, *topic, true)?.output);
    }
    Ok(outputs)
}
