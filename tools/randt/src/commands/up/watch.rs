//! What the supervisor sees of the pipeline.

use crate::report::{Count, Counters};
use crate::results::Results;
use randt_messages::{
    MapperGraph, OdometryStateTopic, RadarScan, StageHealth, StageHealthTopic, StageState, Topic,
    health::text_of,
};
use randt_odometry::Sink;
use randt_stage::{Stage, Subscriber, Waitable};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

/// A stage that has reported nothing for this time is dead or stopped: twice a second it would.
const SILENT: Duration = Duration::from_millis(1500);
/// Stages between the log and the map.
pub const STAGES: [&str; 3] = randt_stage::COMPUTING_STAGES;

/// All states, each once, and the last word of every stage.
pub struct Watch {
    states: Results,
    /// By name and epoch: a stage that came back counts anew.
    health: BTreeMap<(String, u64), StageHealth>,
    heard: BTreeMap<String, Instant>,
    /// Stages that fail again and again: nothing is to be expected of them.
    failing: BTreeSet<String>,
    keyframes: u64,
    loops: u64,
    /// When something came that shows that there is more to come.
    last: Instant,
    states_in: Subscriber<OdometryStateTopic>,
    health_in: Subscriber<StageHealthTopic>,
    graph_in: Subscriber<MapperGraph>,
}

impl Watch {
    /// Opens the topics.
    pub fn open(stage: &mut Stage) -> anyhow::Result<Self> {
        Ok(Self {
            states: Results::merged(),
            health: BTreeMap::new(),
            heard: BTreeMap::new(),
            failing: BTreeSet::new(),
            keyframes: 0,
            loops: 0,
            last: Instant::now(),
            states_in: stage.subscriber()?,
            health_in: stage.subscriber()?,
            graph_in: stage.subscriber()?,
        })
    }

    /// Opens the topics once more, after something happened to the memory that they lie in.
    pub fn reopen(&mut self, stage: &mut Stage) -> anyhow::Result<()> {
        self.states_in = stage.subscriber()?;
        self.health_in = stage.subscriber()?;
        self.graph_in = stage.subscriber()?;
        Ok(())
    }

    /// Says which stages fail again and again.
    pub fn set_failing(&mut self, names: BTreeSet<String>) {
        self.failing = names;
    }

    /// What wakes it.
    pub fn wakes(&self) -> [&dyn Waitable; 3] {
        [&self.states_in, &self.health_in, &self.graph_in]
    }

    /// Takes all that has come.
    pub fn receive(&mut self) -> anyhow::Result<()> {
        while let Some(received) = self.states_in.receive()? {
            let before = self.states.states.len();
            // Odometry that came back sends its last states again.
            self.states.state(received.message().head);
            if self.states.states.len() > before {
                self.last = Instant::now();
            }
        }
        while let Some(received) = self.health_in.receive()? {
            let health = *received.message().head;
            let key = (text_of(&health.name).to_owned(), health.header.epoch);
            self.heard.insert(key.0.clone(), Instant::now());
            self.health.insert(key, health);
        }
        while let Some(received) = self.graph_in.receive()? {
            let head = received.message().head;
            (self.keyframes, self.loops) = (head.keyframes, head.loops);
        }
        // What a stage that is away has not done yet is still to come.
        let is_heard = |name| {
            let heard = self.heard.get(name);
            heard.is_some_and(|heard| heard.elapsed() < SILENT) || self.failing.contains(name)
        };
        if !STAGES.into_iter().all(is_heard) {
            self.last = Instant::now();
        }
        Ok(())
    }

    /// The last word of a stage's last life.
    fn newest(&self, name: &str) -> Option<&StageHealth> {
        let lives = (name.to_owned(), 0)..=(name.to_owned(), u64::MAX);
        self.health.range(lives).last().map(|(_, health)| health)
    }

    /// Whether a stage is in its loop.
    pub fn runs(&self, name: &str) -> bool {
        let health = self.newest(name);
        health.is_some_and(|health| health.state != StageState::Starting as u32)
    }

    /// Whether the log was sent to its end.
    pub fn is_played(&self) -> bool {
        let health = self.newest("play");
        health.is_some_and(|health| health.state == StageState::Finished as u32)
    }

    /// Whether the last scan that was played has its state.
    pub fn is_computed(&self) -> bool {
        let Some(play) = self.newest("play") else {
            return false;
        };
        let mut ports = play.ports().iter().filter(|port| port.publishes == 1);
        let sent = ports.find(|port| text_of(&port.topic) == RadarScan::NAME);
        let last = self.states.states.last();
        sent.zip(last).is_some_and(|(sent, state)| {
            state.scan_epoch == play.header.epoch && state.scan_sequence + 1 == sent.messages
        })
    }

    /// Time since the last state, while all stages were there.
    pub fn quiet_for(&self) -> Duration {
        self.last.elapsed()
    }

    /// Scans with a state.
    pub fn scans(&self) -> u64 {
        self.states.states.len() as u64
    }

    /// The pipeline in a line.
    pub fn line(&self) -> String {
        let newest = self.states.states.last();
        let trust = newest.map_or("-", |state| state.trust().as_str());
        let stages = STAGES.map(|name| {
            let health = self.newest(name);
            let state = health.map_or("dead", |h| StageState::from_code(h.state).as_str());
            match health.map_or(0, |h| h.restarts) {
                0 => format!("{name} {state}"),
                restarts => format!("{name} {state} ({restarts} restarts)"),
            }
        });
        format!(
            "{}; trust {trust}, {} keyframes, {} loops",
            stages.join(", "),
            self.keyframes,
            self.loops
        )
    }

    /// What was lost and how often stages came back, where that is not never.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters::default();
        let (mut lost, mut first) = (0, String::new());
        for ((name, _), health) in &self.health {
            let ports = health.ports().iter().map(|port| {
                let (missed, topic) = (port.lost, text_of(&port.topic));
                (missed, format!("{name} missed {missed} of {topic}"))
            });
            let own = (health.lost, format!("{name}: {}", text_of(&health.message)));
            for (count, text) in ports.chain([own]).filter(|(count, _)| *count > 0) {
                if lost == 0 {
                    first = text;
                }
                lost += count;
            }
        }
        counters.add_lost("messages_lost", lost, first);
        // Its last words stay until what they are about is over.
        let recorder = self.newest("recorder");
        let trouble = recorder.map(|health| text_of(&health.message));
        if let Some(trouble) = trouble.filter(|trouble| !trouble.is_empty()) {
            let first = format!("recorder: {trouble}");
            counters.add_lost("recording_incomplete", 1, first);
        }
        let newest = STAGES.iter().filter_map(|name| self.newest(name));
        let (count, loss) = (newest.map(|health| health.restarts).sum(), false);
        let first = String::new();
        counters.add("stage_restarts", Count { count, loss, first });
        counters
    }

    /// The states; there are none left afterwards.
    pub fn take_states(&mut self) -> Results {
        std::mem::take(&mut self.states)
    }
}
