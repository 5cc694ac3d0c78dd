//! What makes the recorder a stage: all topics, read as they come.
//!
//! Only with the feature `process`.

use crate::{
    CLOCK_METADATA, Continuity, Positions, Preamble, Queue, Raw, VERSIONS_METADATA,
    configuration_records, fields, machine_record,
};
use randt_config::Loaded;
use randt_messages::{
    ImuSampleTopic, Keyframe, MapperCorrection, MapperGraph, MapperGrid, OdometryStateTopic,
    RadarPoints, RadarScan, StageHealthTopic, Topic,
};
use randt_stage::{Clock, Domain, Error, Registry, Stage, Subscriber, Waitable};
use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

/// Reads one topic.
trait TopicReader {
    /// Copies what has come.
    fn drain(&mut self, into: &mut Vec<Raw>) -> Result<(), Error>;
    fn topic(&self) -> &'static str;
    /// Messages that its port counts as missed.
    fn missed(&self) -> u64;
    fn waitable(&self) -> &dyn Waitable;
}

impl<T: Topic> TopicReader for Subscriber<T> {
    fn drain(&mut self, into: &mut Vec<Raw>) -> Result<(), Error> {
        while let Some(received) = self.receive()? {
            into.push(Raw::from_message(received.message()));
        }
        Ok(())
    }

    fn topic(&self) -> &'static str {
        T::NAME
    }

    fn missed(&self) -> u64 {
        self.missed()
    }

    fn waitable(&self) -> &dyn Waitable {
        self
    }
}

/// All topics.
pub struct Inputs {
    readers: Vec<Box<dyn TopicReader>>,
    batch: Vec<Raw>,
    continuity: Continuity,
}

impl Inputs {
    /// Begins to read them. Publishers hand over what is in reach: what a recorder that was killed did not bring to the
    /// disk is recorded again. `recorded`: what the files hold; what is missing behind it is counted.
    pub fn open(stage: &mut Stage, recorded: Positions) -> Result<Self, Error> {
        Ok(Self {
            readers: vec![
                reader::<RadarScan>(stage)?,
                reader::<ImuSampleTopic>(stage)?,
                reader::<RadarPoints>(stage)?,
                reader::<OdometryStateTopic>(stage)?,
                reader::<Keyframe>(stage)?,
                reader::<MapperCorrection>(stage)?,
                reader::<MapperGraph>(stage)?,
                reader::<MapperGrid>(stage)?,
                reader::<StageHealthTopic>(stage)?,
            ],
            batch: Vec::new(),
            continuity: Continuity::after(recorded),
        })
    }

    /// Takes all that has come to the queue, in the order in which it was published.
    pub fn drain(&mut self, queue: &Queue, clock: Clock) -> Result<(), Error> {
        self.continuity.listen(clock.now_ns());
        for reader in &mut self.readers {
            reader.drain(&mut self.batch)?;
        }
        self.batch.sort_by_key(|raw| raw.label.time_ns);
        for raw in &self.batch {
            if let Some(gap) = self.continuity.take(raw) {
                queue.missed(raw.topic, &gap);
            }
        }
        queue.push(self.batch.drain(..), clock.now_ns());
        Ok(())
    }

    /// Messages that the ports count as missed.
    pub fn missed_by_ports(&self) -> u64 {
        self.readers.iter().map(|reader| reader.missed()).sum()
    }

    /// What to sleep on: not on the IMU, whose buffer holds 8 s and which would wake a core 250 times a second.
    pub fn wakes(&self) -> Vec<&dyn Waitable> {
        let slow = self
            .readers
            .iter()
            .filter(|reader| reader.topic() != ImuSampleTopic::NAME);
        slow.map(|reader| reader.waitable()).collect()
    }

    /// Names of the topics.
    pub fn topics(&self) -> impl Iterator<Item = &'static str> {
        self.readers.iter().map(|reader| reader.topic())
    }
}

fn reader<T: Topic>(stage: &mut Stage) -> Result<Box<dyn TopicReader>, Error> {
    Ok(Box::new(stage.subscriber::<T>()?))
}

/// The metadata at the beginning of every file.
pub fn preamble(loaded: &Loaded, domain: &Domain, clock: Clock) -> Preamble {
    let mut fixed = configuration_records(loaded);
    fixed.push(machine_record());
    let domain = domain.clone();
    Box::new(move || {
        let mut records = fixed.clone();
        records.push((VERSIONS_METADATA, versions(&domain)));
        records.push((CLOCK_METADATA, clock_fields(clock)));
        records
    })
}

/// Every stage that runs, with its build; this one among them.
fn versions(domain: &Domain) -> BTreeMap<String, String> {
    let living = Registry::all(domain)
        .into_iter()
        .filter(|(_, lives)| *lives);
    living
        .map(|(entry, _)| (entry.name, entry.version))
        .collect()
}

/// The pipeline's clock and the date: stamps are the time since the boot plus the anchor.
fn clock_fields(clock: Clock) -> BTreeMap<String, String> {
    let date = SystemTime::now().duration_since(UNIX_EPOCH);
    let date_ns = date.map_or(0, |since| since.as_nanos());
    fields([
        ("anchor_ns", clock.anchor_ns().to_string()),
        ("now_ns", clock.now_ns().to_string()),
        ("date_ns", date_ns.to_string()),
    ])
}
