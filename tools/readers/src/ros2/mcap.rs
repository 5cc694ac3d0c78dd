//! A ROS bag in MCAP as a recording: CDR (ROS 2) or, as converters write it, ROS 1's
//! serialisation.

use crate::ros::{Channel, Encoding, Kind, Raw, Recording};
use crate::summary::Summary;
use crate::{Error, counters::Counters};
use randt_log::{Damage, LogReader};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Messages of static transforms that are kept.
const TRANSFORMS_MAX: usize = 1000;

/// An MCAP file that is being read.
#[derive(Debug)]
pub(crate) struct McapBag {
    reader: LogReader<BufReader<File>>,
    channels: Vec<Channel>,
    transforms: Vec<Vec<u8>>,
    /// The reader's damage that is counted already.
    counted: Vec<Damage>,
}

/// What matters of a channel, or `None` where its messages have an encoding that is not ROS's.
fn channel(topic: &str, type_name: &str, encoding: &str) -> Option<Channel> {
    let encoding = match encoding {
        "cdr" => Encoding::Cdr,
        "ros1" => Encoding::Ros1,
        _ => return None,
    };
    Some(Channel {
        topic: topic.to_owned(),
        type_name: type_name.to_owned(),
        kind: Kind::from_topic(topic, type_name),
        encoding,
        messages: 0,
    })
}

impl McapBag {
    /// Opens a file and finds its topics and static transforms: by its summary or, where that is
    /// damaged, by reading it through once.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut bag = Self {
            reader: LogReader::open(path)?,
            channels: Vec::new(),
            transforms: Vec::new(),
            counted: Vec::new(),
        };
        if !bag.read_summary(path) {
            (bag.channels, bag.transforms) = (Vec::new(), Vec::new());
            bag.read_through(path)?;
        }
        Ok(bag)
    }

    /// The index of a channel in the list, to which it is added if it is new.
    fn index_of(&mut self, topic: &str, type_name: &str, encoding: &str) -> Option<usize> {
        let same = |c: &Channel| c.topic == topic && c.type_name == type_name;
        if let Some(index) = self.channels.iter().position(same) {
            return Some(index);
        }
        self.channels.push(channel(topic, type_name, encoding)?);
        Some(self.channels.len() - 1)
    }

    /// False where the file has no whole summary.
    fn read_summary(&mut self, path: &Path) -> bool {
        let Some(mut summary) = Summary::read(path) else {
            return false;
        };
        for (topic, type_name, encoding, messages) in summary.channels() {
            if let Some(index) = self.index_of(&topic, &type_name, &encoding)
                && let Some(channel) = self.channels.get_mut(index)
            {
                channel.messages += messages;
            }
        }
        let fixed = self
            .channels
            .iter()
            .filter(|c| c.kind == Kind::StaticTransforms);
        let topics: Vec<String> = fixed.map(|c| c.topic.clone()).collect();
        match summary.messages_of(&topics, TRANSFORMS_MAX) {
            Some(messages) => self.transforms = messages,
            None => return false,
        }
        true
    }

    fn read_through(&mut self, path: &Path) -> Result<(), Error> {
        let mut reader = LogReader::open(path)?;
        while let Some(entry) = reader.next_entry()? {
            let from = entry.channel;
            let Some(index) = self.index_of(&from.topic, &from.type_name, &from.message_encoding)
            else {
                continue;
            };
            if let Some(channel) = self.channels.get_mut(index) {
                channel.messages += 1;
                if channel.kind == Kind::StaticTransforms && self.transforms.len() < TRANSFORMS_MAX
                {
                    self.transforms.push(entry.bytes.to_vec());
                }
            }
        }
        Ok(())
    }
}

/// Counts what a reader met of damage since it was last asked.
pub(crate) fn count_damage(now: &[Damage], counted: &mut Vec<Damage>, counters: &mut Counters) {
    for damage in now {
        let known = counted
            .iter()
            .find(|known| known.kind == damage.kind)
            .map_or(0, |k| k.count);
        let new = damage.count.saturating_sub(known);
        counters.count_loss(damage.kind.name(), new, || damage.first.clone());
    }
    if now != counted.as_slice() {
        *counted = now.to_vec();
    }
}

impl Recording for McapBag {
    fn format(&self) -> &'static str {
        "ros2-mcap"
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn close(&mut self, counters: &mut Counters) {
        count_damage(self.reader.damage(), &mut self.counted, counters);
    }

    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        self.close(counters);
        let Some(entry) = self.reader.next_entry()? else {
            return Ok(None);
        };
        let from = entry.channel;
        let same = |c: &Channel| c.topic == from.topic && c.type_name == from.type_name;
        Ok(Some(Raw {
            // A channel that is not ROS's has no index: the one behind the last is used by none.
            channel: self
                .channels
                .iter()
                .position(same)
                .unwrap_or(self.channels.len()),
            arrival_ns: entry.time_ns,
            offset: entry.offset,
            bytes: entry.bytes,
        }))
    }
}
