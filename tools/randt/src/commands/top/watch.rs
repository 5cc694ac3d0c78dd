//! Collects what a pipeline publishes, while its stages come and go.

use super::feed::Feed;
use super::snapshot::{Map, Robot, Snapshot};
use super::stages::Stages;
use super::traffic::Traffic;
use crate::latency::Latencies;
use randt_messages::{
    Correction, GraphHead, MapperCorrection, MapperGraph, OdometryState, OdometryStateTopic,
    StageHealthTopic,
};
use randt_stage::{Clock, Domain, Entry, Observer, Registry, memory_gone};

/// What was seen of a domain.
pub struct Watch {
    domain: Domain,
    connection: Option<Connection>,
    /// Of the last connection: what was seen ages when all stages are gone.
    clock: Option<Clock>,
    stages: Stages,
    traffic: Traffic,
    latencies: Latencies,
    state: Option<OdometryState>,
    correction: Option<Correction>,
    graph: Option<GraphHead>,
}

struct Connection {
    // Ports go before the node that they belong to.
    health: Feed<StageHealthTopic>,
    states: Feed<OdometryStateTopic>,
    corrections: Feed<MapperCorrection>,
    graph: Feed<MapperGraph>,
    observer: Observer,
}

impl Watch {
    /// Of a domain that may still be empty.
    pub fn new(domain: Domain) -> Self {
        Self {
            domain,
            connection: None,
            clock: None,
            stages: Stages::default(),
            traffic: Traffic::default(),
            latencies: Latencies::default(),
            state: None,
            correction: None,
            graph: None,
        }
    }

    /// The domain.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Whether a pipeline is there.
    pub fn is_connected(&self) -> bool {
        self.connection.is_some()
    }

    /// Reads the register and the topics, and gives what is known now.
    pub fn refresh(&mut self) -> anyhow::Result<Snapshot> {
        // Before anything in it is opened: another user may have put links there.
        self.domain.check_owner()?;
        let register = Registry::all(&self.domain);
        let living = register.iter().filter(|(_, lives)| *lives);
        let living: Vec<Entry> = living.map(|(entry, _)| entry.clone()).collect();
        // Stages of another build may come next; they would find what this process holds. Others
        // come back in memory that is made anew; those that do not are listed below.
        let is_whole = |it: &Connection| !living.is_empty() && it.observer.check_memory().is_ok();
        self.connection = self.connection.take().filter(is_whole);
        if self.connection.is_none() && !living.is_empty() {
            self.connection = Observer::enter(&self.domain)?.map(Connection::new);
        }
        if let Some(connection) = &mut self.connection {
            connection.follow(&living);
            self.clock = Some(connection.observer.clock());
        }
        self.read();
        Ok(self.snapshot(&register))
    }

    /// Takes what has come.
    pub fn read(&mut self) {
        let Some(connection) = &mut self.connection else {
            return;
        };
        let observer = &connection.observer;
        connection.health.read(observer, |message| {
            self.stages.push(message.head);
            self.traffic.push(message.head);
        });
        connection.states.read(observer, |message| {
            self.latencies.push(message.head);
            self.state = Some(*message.head);
        });
        connection.corrections.read(observer, |message| {
            self.correction = Some(*message.head);
        });
        connection.graph.read(observer, |message| {
            self.graph = Some(*message.head);
        });
    }

    fn snapshot(&mut self, register: &[(Entry, bool)]) -> Snapshot {
        let now_ns = self.clock.map(|clock| clock.now_ns());
        let stages = self.stages.rows(register, now_ns);
        let with_message = stages.iter().filter(|stage| !stage.message.is_empty());
        let mut notes: Vec<String> = with_message
            .map(|stage| format!("{}: {}", stage.name, stage.message))
            .collect();
        let living = register.iter().filter(|(_, lives)| *lives);
        notes.extend(living.filter_map(|(entry, _)| memory_text(&self.domain, entry)));
        match &self.connection {
            Some(connection) => notes.extend(connection.troubles()),
            None => notes.push(format!(
                "no pipeline is there: no stage lives in {}",
                self.domain.folder().display()
            )),
        }
        let robot = self.state.as_ref().zip(now_ns);
        let correction = self.correction.as_ref();
        let robot = robot.map(|(state, now_ns)| Robot::from_state(state, correction, now_ns));
        let doubted = robot.as_ref().filter(|robot| robot.trust != "good");
        notes.extend(doubted.map(|robot| format!("trust is {}", robot.trust_text)));
        Snapshot {
            prefix: self.domain.prefix().to_owned(),
            run: self.domain.run().display().to_string(),
            stages,
            topics: now_ns.map_or_else(Vec::new, |now_ns| self.traffic.topics(now_ns)),
            latency_ms: self.latencies.figures(),
            robot,
            map: self.graph.as_ref().map(Map::from),
            notes,
        }
    }
}

/// The text about a stage whose shared memory was removed or cut.
fn memory_text(domain: &Domain, entry: &Entry) -> Option<String> {
    let gone = memory_gone(domain, entry);
    let (files, first, name) = (gone.len(), gone.first()?.display(), &entry.name);
    Some(format!(
        "{name}: its shared memory is gone ({files} files, {first} among them): randt doctor has the details"
    ))
}

impl Connection {
    fn new(observer: Observer) -> Self {
        Self {
            health: Feed::default(),
            states: Feed::default(),
            corrections: Feed::default(),
            graph: Feed::default(),
            observer,
        }
    }

    fn follow(&mut self, living: &[Entry]) {
        self.health.follow(&self.observer, living);
        self.states.follow(&self.observer, living);
        self.corrections.follow(&self.observer, living);
        self.graph.follow(&self.observer, living);
    }

    fn troubles(&self) -> impl Iterator<Item = String> {
        let troubles = [
            self.health.trouble(),
            self.states.trouble(),
            self.corrections.trouble(),
            self.graph.trouble(),
        ];
        troubles.into_iter().flatten().cloned()
    }
}
