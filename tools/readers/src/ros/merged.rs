//! The files of one recording as one, its messages in the order in which they were recorded.
//!
//! Recorders overlap where one file ends and the next begins, and programs that rewrite a
//! recording put one topic behind the other. So files are merged by the time of recording, and a
//! stream that stands elsewhere in its file gets a reader of its own.

mod part;

use super::recording::{Channel, Kind, Raw, Recording};
use crate::{Error, counters::Counters};
use part::{Message, Part};
use std::path::{Path, PathBuf};

/// Opens one file of a recording.
pub(crate) type Open = fn(&Path) -> Result<Box<dyn Recording>, Error>;

/// The files of a recording as one.
pub(crate) struct Merged {
    open: Open,
    parts: Vec<Part>,
    channels: Vec<Channel>,
    transforms: Vec<Vec<u8>>,
    /// Whether a channel's messages are wanted, and whether they must stand in order.
    wanted: Vec<(bool, bool)>,
    /// Why files are missing; counted with the first message.
    unreadable: Vec<String>,
    present: Message,
}

impl Merged {
    /// Looks into each file for its topics and its first message.
    pub fn new(files: Vec<PathBuf>, open: Open) -> Result<Self, Error> {
        let is_single = files.len() == 1;
        let mut unreadable = Vec::new();
        let (mut channels, mut transforms) = (Vec::new(), Vec::new());
        let mut parts = Vec::new();
        for path in files {
            match Part::new(path, (open, is_single), &mut channels, &mut transforms) {
                Ok(part) => parts.push(part),
                Err(error) if is_single => return Err(error),
                Err(error) => unreadable.push(error.to_string()),
            }
        }
        Ok(Self {
            open,
            parts,
            wanted: vec![(true, false); channels.len()],
            channels,
            transforms,
            unreadable,
            present: Message::default(),
        })
    }

    /// Whether there is no file that can be read.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Adds files that should be there.
    pub fn add_missing(&mut self, missing: Vec<String>) {
        self.unreadable.extend(missing);
    }

    /// Why files are missing.
    pub fn unreadable(&self) -> &[String] {
        &self.unreadable
    }

    /// The part and reader that have the message recorded first; opens parts whose time has come.
    fn earliest(&mut self, counters: &mut Counters) -> Result<Option<(usize, usize)>, Error> {
        loop {
            let parts = self.parts.iter().enumerate();
            let earliest = parts.filter_map(|(at, part)| Some((part.earliest()?, at)));
            let earliest = earliest.min_by_key(|((arrival_ns, _), at)| (*arrival_ns, *at));
            let limit_ns = earliest.map_or(i64::MAX, |((arrival_ns, _), _)| arrival_ns);
            let closed = self.parts.iter_mut().filter(|part| part.is_closed());
            let due = closed.min_by_key(|part| part.first_ns);
            match due.filter(|part| part.first_ns <= limit_ns) {
                Some(part) => part.begin(self.open, &self.wanted, counters)?,
                None => return Ok(earliest.map(|((_, reader), part)| (part, reader))),
            }
        }
    }
}

impl Recording for Merged {
    fn format(&self) -> &'static str {
        self.parts.first().map_or("ros2-mcap", |part| part.format)
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn static_transforms(&self) -> &[Vec<u8>] {
        &self.transforms
    }

    /// The wanted ones are read in the order of recording.
    fn select(&mut self, wanted: &[usize]) {
        let channels = self.channels.iter().enumerate();
        let choice = channels.map(|(index, channel)| match channel.kind {
            Kind::Transforms | Kind::RadarConfiguration => (true, false),
            _ => (wanted.contains(&index), wanted.contains(&index)),
        });
        self.wanted = choice.collect();
    }

    fn first_messages(&self, channels: &[usize]) -> Vec<Option<Vec<u8>>> {
        let mut found = vec![None; channels.len()];
        for part in &self.parts {
            if found.iter().any(Option::is_none) {
                part.find_first(self.open, channels, &mut found);
            }
        }
        found
    }

    fn close(&mut self, counters: &mut Counters) {
        self.parts.iter_mut().for_each(|part| part.close(counters));
    }

    fn next_message(&mut self, counters: &mut Counters) -> Result<Option<Raw<'_>>, Error> {
        for why in self.unreadable.drain(..) {
            counters.count_loss("bag_parts_unreadable", 1, || why);
        }
        let Some((at, reader)) = self.earliest(counters)? else {
            return Ok(None);
        };
        let Some(part) = self.parts.get_mut(at) else {
            return Ok(None);
        };
        part.take(reader, &mut self.present, self.open, &self.wanted, counters)?;
        // Where two files overlap they may both have a message.
        for (other, part) in self.parts.iter_mut().enumerate() {
            if other != at && part.drop_repeated(&self.present, &self.wanted, counters)? {
                let (arrival_ns, path) = (self.present.arrival_ns, part.path.display());
                counters.count_event("messages_in_two_files", 1, || {
                    format!(
                        "{path}: the message recorded at {arrival_ns} ns is in another file too"
                    )
                });
            }
        }
        let Message {
            channel,
            arrival_ns,
            offset,
            ref bytes,
        } = self.present;
        Ok(Some(Raw {
            channel,
            arrival_ns,
            offset,
            bytes,
        }))
    }
}
