//! A ROS 1 bag as a recording, chunk by chunk, over damage.

use super::chunk::ChunkHeader;
use super::record::{Fields, Op, Record, connection};
use super::walker::{MAGIC, Step, Walker};
use crate::ros::{Channel, Encoding, Kind, Raw, Recording};
use crate::{Error, counters::Counters};
use core::ops::Range;
use std::collections::BTreeMap;
use std::path::Path;

/// Damaged records after which the rest is given up: each costs a search through the file.
const DAMAGE_MAX: u64 = 1000;
/// Messages of static transforms that are kept; a robot has one for each publisher.
const TRANSFORMS_MAX: usize = 1000;

/// A bag that is being read.
#[derive(Debug)]
pub(crate) struct Bag {
    walker: Walker,
    /// Where the index begins; 0 where the recorder never came to write it.
    index_at: u64,
    channels: Vec<Channel>,
    /// Index into `channels` by the bag's connection number.
    numbers: BTreeMap<u32, usize>,
    transforms: Vec<Vec<u8>>,
    chunk: Chunk,
    damages: u64,
}

/// The chunk that is being read.
#[derive(Debug, Default)]
struct Chunk {
    bytes: Vec<u8>,
    /// Where its record and its stored bytes begin in the file.
    at: u64,
    data_at: u64,
    /// Beginning of the next record in `bytes`.
    cursor: usize,
    /// Why its end could not be decompressed.
    broken: Option<String>,
}

/// A message in the present chunk.
struct Found {
    channel: usize,
    arrival_ns: i64,
    bytes: Range<usize>,
}

/// What a first walk over the file, without decompression, finds.
#[derive(Debug, Default)]
struct Survey {
    /// Messages by connection number.
    counts: BTreeMap<u32, u64>,
    /// Where each chunk begins and the connections in it.
    chunks: Vec<(u64, Vec<u32>)>,
    damaged: bool,
}

impl Bag {
    /// Opens a bag and finds its topics and static transforms: by its indices or, where these are
    /// damaged, by reading it through once.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut bag = Self {
            walker: Walker::open(path)?,
            index_at: 0,
            channels: Vec::new(),
            numbers: BTreeMap::new(),
            transforms: Vec::new(),
            chunk: Chunk::default(),
            damages: 0,
        };
        let survey = bag.survey()?;
        let mut chunks = survey.chunks.iter();
        let is_indexed = chunks.all(|(_, connections)| !connections.is_empty());
        let mut numbers = survey.counts.keys();
        let is_named = numbers.all(|number| bag.numbers.contains_key(number));
        if is_indexed && is_named && !survey.damaged {
            for (number, count) in &survey.counts {
                let index = bag.numbers.get(number).copied();
                if let Some(channel) = index.and_then(|index| bag.channels.get_mut(index)) {
                    channel.messages += count;
                }
            }
            for (at, numbers) in survey.chunks {
                if numbers.iter().any(|number| bag.is_static(*number)) {
                    bag.collect(at, Some(at))?;
                }
            }
        } else {
            bag.collect(MAGIC.len() as u64, None)?;
        }
        bag.seek(MAGIC.len() as u64);
        Ok(bag)
    }

    fn is_static(&self, number: u32) -> bool {
        let index = self.numbers.get(&number);
        let channel = index.and_then(|index| self.channels.get(*index));
        channel.is_some_and(|channel| channel.kind == Kind::StaticTransforms)
    }

    fn seek(&mut self, at: u64) {
        self.walker.at = at;
        self.chunk = Chunk::default();
        self.damages = 0;
    }

    fn survey(&mut self) -> Result<Survey, Error> {
        let mut survey = Survey::default();
        loop {
            match self.walker.step()? {
                Step::End => return Ok(survey),
                Step::Damage { .. } => {
                    survey.damaged = true;
                    return Ok(survey);
                }
                Step::Chunk { at, missing, .. } => {
                    survey.damaged |= missing > 0;
                    survey.chunks.push((at, Vec::new()));
                }
                Step::Record { op, header, data } => {
                    let Some(fields) = Fields::parse(&header) else {
                        continue;
                    };
                    match op {
                        Op::BagHeader => self.index_at = fields.u64("index_pos").unwrap_or(0),
                        Op::Connection => self.register(&fields, &data),
                        Op::Index => {
                            let count = fields.u32("count");
                            if let Some((number, count)) = fields.u32("conn").zip(count) {
                                *survey.counts.entry(number).or_default() += u64::from(count);
                                if let Some((_, numbers)) = survey.chunks.last_mut() {
                                    numbers.push(number);
                                }
                            }
                        }
                        Op::Message | Op::Chunk | Op::ChunkInfo => {}
                    }
                }
            }
        }
    }

    /// Reads from `at` and keeps static transforms: of one chunk, or of all, counting every
    /// message.
    fn collect(&mut self, at: u64, only_chunk: Option<u64>) -> Result<(), Error> {
        self.seek(at);
        // The reading proper will count the damage.
        let mut unseen = Counters::default();
        while let Some(found) = self.advance(&mut unseen)? {
            if only_chunk.is_some_and(|chunk| chunk != self.chunk.at) {
                break;
            }
            let Some(channel) = self.channels.get_mut(found.channel) else {
                continue;
            };
            if only_chunk.is_none() {
                channel.messages += 1;
            }
            if channel.kind == Kind::StaticTransforms && self.transforms.len() < TRANSFORMS_MAX {
                let bytes = self.chunk.bytes.get(found.bytes).unwrap_or_default();
                self.transforms.push(bytes.to_vec());
            }
        }
        Ok(())
    }

    fn register(&mut self, fields: &Fields, data: &[u8]) {
        let Some((number, topic, type_name)) = connection(fields, data) else {
            return;
        };
        // Several publishers of one topic have a connection each: one channel for all.
        let same = |c: &Channel| c.topic == topic && c.type_name == type_name;
        let index = self.channels.iter().position(same).unwrap_or_else(|| {
            self.channels.push(Channel {
                kind: Kind::from_topic(&topic, &type_name),
                topic,
                type_name,
                encoding: Encoding::Ros1,
                messages: 0,
            });
            self.channels.len() - 1
        });
        self.numbers.entry(number).or_insert(index);
    }

    /// The next message of the present chunk, of the next one, or of the next whole one.
    fn advance(&mut self, counters: &mut Counters) -> Result<Option<Found>, Error> {
        loop {
            let chunk = &self.chunk;
            let rest = chunk.bytes.get(chunk.cursor..).unwrap_or_default();
            if rest.is_empty() && self.chunk.broken.is_none() {
                if !self.next_chunk(counters)? {
                    return Ok(None);
                }
                continue;
            }
            let Some(record) = Record::parse(rest) else {
                let inside = self.chunk.cursor;
                let why = self.chunk.broken.take();
                let why = why.unwrap_or_else(|| "no record of a bag".to_owned());
                let what = format!("chunk readable for {inside} bytes, then {why}");
                let (at, from) = (self.chunk.at, self.chunk.data_at);
                self.chunk.bytes.clear();
                let damage = self.walker.damage(at, from, what)?;
                if !self.count_damage(damage, counters)? {
                    return Ok(None);
                }
                continue;
            };
            let start = self.chunk.cursor + record.length - record.data.len();
            let bytes = start..start + record.data.len();
            let (fields, length) = (record.fields, record.length);
            match fields.op() {
                Some(Op::Message) => {
                    let number = fields.u32("conn");
                    let channel = number.and_then(|number| self.numbers.get(&number)).copied();
                    let arrival_ns = fields.time_ns("time").unwrap_or(0);
                    self.chunk.cursor += length;
                    if let Some(channel) = channel {
                        return Ok(Some(Found {
                            channel,
                            arrival_ns,
                            bytes,
                        }));
                    }
                    let (path, at) = (self.walker.path.display(), self.chunk.at);
                    let first = || {
                        format!("{path}: chunk at byte {at}: connection {number:?} is not declared")
                    };
                    counters.count_loss("messages_of_unknown_topic", 1, first);
                }
                Some(Op::Connection) => {
                    // Owned, because registering needs the whole bag.
                    let record: Vec<u8> = rest.get(..length).unwrap_or_default().to_vec();
                    self.chunk.cursor += length;
                    if let Some(record) = Record::parse(&record) {
                        self.register(&record.fields, record.data);
                    }
                }
                _ => self.chunk.cursor += length,
            }
        }
    }

    /// Loads the next chunk, as far as it can be decompressed; false at the end.
    fn next_chunk(&mut self, counters: &mut Counters) -> Result<bool, Error> {
        loop {
            match self.walker.step()? {
                Step::End => {
                    self.count_missing_end(counters);
                    return Ok(false);
                }
                Step::Record { op, header, data } => {
                    if let (Op::Connection, Some(fields)) = (op, Fields::parse(&header)) {
                        self.register(&fields, &data);
                    }
                }
                Step::Chunk {
                    header,
                    at,
                    data_at,
                    stored,
                    missing,
                } => {
                    self.load(header, at, data_at, stored, missing)?;
                    return Ok(true);
                }
                damage @ Step::Damage { .. } => {
                    if !self.count_damage(damage, counters)? {
                        return Ok(false);
                    }
                }
            }
        }
    }

    /// A file that ends between two records shows it only by where its header puts the index.
    fn count_missing_end(&self, counters: &mut Counters) {
        let (path, length) = (self.walker.path.display(), self.walker.length);
        let index_at = self.index_at;
        if index_at == 0 {
            let first =
                || format!("{path}: the recorder wrote no index; all {length} bytes were read");
            counters.count_event("bag_not_closed", 1, first);
        } else if index_at > length && self.damages == 0 {
            let what =
                format!("the file ends at byte {length}, before its index at byte {index_at}");
            counters.count_loss("bag_damaged", 1, || format!("{path}: {what}"));
        }
    }

    fn load(
        &mut self,
        header: ChunkHeader,
        at: u64,
        data_at: u64,
        stored: u64,
        missing: u64,
    ) -> Result<(), Error> {
        let chunk = &mut self.chunk;
        chunk.bytes.clear();
        (chunk.at, chunk.data_at, chunk.cursor) = (at, data_at, 0);
        let reader = self.walker.stored(data_at, stored)?;
        let result = header.decompress(reader, &mut chunk.bytes);
        chunk.broken = match result {
            _ if missing > 0 => Some(format!("the file ends {missing} bytes too early")),
            Err(error) => Some(error.to_string()),
            Ok(()) => None,
        };
        Ok(())
    }

    /// Counts a damaged record; false where reading ends there.
    fn count_damage(&mut self, damage: Step, counters: &mut Counters) -> Result<bool, Error> {
        let Step::Damage { at, what, resumed } = damage else {
            return Ok(true);
        };
        self.damages += 1;
        let path = self.walker.path.display();
        let goes_on = resumed < self.walker.length && self.damages < DAMAGE_MAX;
        let first = || {
            if goes_on {
                format!(
                    "{path}: at byte {at}: {what}; reading goes on with the chunk at byte {resumed}"
                )
            } else {
                format!("{path}: at byte {at}: {what}; nothing behind it can be read")
            }
        };
        // Behind the last chunk is only the index, which was not needed.
        if self.index_at > 0 && at >= self.index_at && resumed == self.walker.length {
            counters.count_event("bag_index_damaged", 1, first);
        } else {
            counters.count_loss("bag_damaged", 1, first);
        }
        Ok(goes_on)
    }
}

impl Recording for Bag {
    fn format(&self) -> &'static str {
        "ros1-bag"
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        let Some(found) = self.advance(counters)? else {
            return Ok(None);
        };
        Ok(Some(Raw {
            channel: found.channel,
            arrival_ns: found.arrival_ns,
            offset: self.chunk.at,
            bytes: self.chunk.bytes.get(found.bytes).unwrap_or_default(),
        }))
    }
}
