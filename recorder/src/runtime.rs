//! What makes the recorder a stage: all topics, read as they come.
//!
//! Only with the feature `runtime`.

use crate::{
    CLOCK_METADATA, Continuity, Positions, Preamble, Queue, Raw, VERSIONS_METADATA,
    configuration_records, fields, machine_record,
};
use randt_config::Loaded;
use randt_messages::{ImuSampleTopic, Topic, TopicVisitor, TwistTopic, visit_bus_topics};
use randt_stage::{Clock, Domain, Error, Registry, Stage, Subscriber, Waitable};
use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

/// One topic on its way into the queue.
trait TopicInput: Waitable {
    /// Copies what has come.
    fn drain(&mut self, into: &mut Vec<Raw>) -> Result<(), Error>;
    /// Messages that its port counts as missed.
    fn missed(&self) -> u64;
}

impl<T: Topic> TopicInput for Subscriber<T> {
    fn drain(&mut self, into: &mut Vec<Raw>) -> Result<(), Error> {
        while let Some(received) = self.receive()? {
            into.push(Raw::from_message(received.message()));
        }
        Ok(())
    }

    fn missed(&self) -> u64 {
        self.missed()
    }
}

/// Topics by name.
type TopicInputs = Vec<(&'static str, Box<dyn TopicInput>)>;

/// Opens every topic for reading.
struct Readers<'a> {
    stage: &'a mut Stage,
    topics: TopicInputs,
}

impl TopicVisitor for Readers<'_> {
    type Error = Error;

    fn visit<T: Topic>(&mut self) -> Result<(), Error> {
        let input = Box::new(self.stage.subscriber::<T>()?);
        self.topics.push((T::NAME, input));
        Ok(())
    }
}

/// All topics.
pub struct Inputs {
    topics: TopicInputs,
    batch: Vec<Raw>,
    continuity: Continuity,
}

impl Inputs {
    /// Begins to read them; their writers deliver the history that they still hold, so that what a
    /// recorder that was killed did not bring to the disk is recorded again. `recorded`: what the
    /// files hold; what is missing behind it is counted.
    pub fn open(stage: &mut Stage, recorded: Positions) -> Result<Self, Error> {
        let topics = Vec::new();
        let mut readers = Readers { stage, topics };
        visit_bus_topics(&mut readers)?;
        Ok(Self {
            topics: readers.topics,
            batch: Vec::new(),
            continuity: Continuity::after(recorded),
        })
    }

    /// Takes all that has come to the queue, in the order in which it was published.
    pub fn drain(&mut self, queue: &Queue, clock: Clock) -> Result<(), Error> {
        self.continuity.listen(clock.now_ns());
        for (_, input) in &mut self.topics {
            input.drain(&mut self.batch)?;
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
        self.topics.iter().map(|(_, input)| input.missed()).sum()
    }

    /// What to sleep on: not on the IMU, whose buffer holds 8 s and which would wake a core 250
    /// times a second, nor on twists.
    pub fn waitables(&self) -> Vec<&dyn Waitable> {
        let topics = self.topics.iter();
        let fast = [ImuSampleTopic::NAME, TwistTopic::NAME];
        let slow = topics.filter(|(topic, _)| !fast.contains(topic));
        slow.map(|(_, input)| &**input as &dyn Waitable).collect()
    }
}

/// What every file says at its beginning.
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
    let stages = Registry::all(domain).into_iter();
    let living = stages.filter(|(_, lives)| *lives).map(|(entry, _)| entry);
    living.map(|entry| (entry.name, entry.version)).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::BUS_TOPICS;

    /// `randt top` shows what stages report of their ports
    /// (`tools/randt/src/commands/top/traffic.rs`).
    #[test]
    fn a_registered_topic_has_its_qos_and_its_channel_and_is_recorded() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("every-topic", Some(run.path())).unwrap();
        let mut stage = Stage::open("recorder", &domain).unwrap();
        let inputs = Inputs::open(&mut stage, Positions::default()).unwrap();
        let registered = || BUS_TOPICS.iter().map(|topic| topic.name);
        let read = inputs.topics.iter().map(|(topic, _)| *topic);
        assert!(read.eq(registered()));
        for topic in BUS_TOPICS {
            let channel = randt_log::channel_of(topic.name).unwrap();
            assert_eq!(channel.layout(), topic.type_name);
        }
        drop((inputs, stage));
        randt_stage::wipe(&domain, true).unwrap();
    }
}
