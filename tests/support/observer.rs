//! An observer in a domain: subscribes to every stage's health and odometry's states, and knows
//! the processes.

use randt_messages::{
    Keyframe, OdometryState, OdometryStateTopic, StageHealthTopic, StageState, health::text_of,
};
use randt_stage::{Domain, Registry, Stage, Subscriber, WakeReason};
use std::time::{Duration, Instant};

/// One process of a stage that was in its loop.
#[derive(Clone, Debug)]
pub struct Life {
    pub name: String,
    pub pid: u64,
    /// When the process began, and when it first reported that it runs, ns.
    pub started_ns: i64,
    pub running_ns: i64,
    /// Its last word, ns.
    pub newest_ns: i64,
}

/// A stage of its own that only listens.
pub struct Observer {
    stage: Stage,
    health: Subscriber<StageHealthTopic>,
    states: Subscriber<OdometryStateTopic>,
    keyframes: Subscriber<Keyframe>,
    pub lives: Vec<Life>,
    /// The newest state, the stamp of the first, and the keyframes that came.
    pub state: Option<OdometryState>,
    pub first_ns: Option<i64>,
    pub keyframes_heard: u64,
}

impl Observer {
    pub fn enter(domain: &Domain) -> Self {
        let mut stage = Stage::open("observer", domain).unwrap();
        let mut observer = Self {
            health: stage.subscriber().unwrap(),
            states: stage.subscriber().unwrap(),
            keyframes: stage.subscriber().unwrap(),
            stage,
            lives: Vec::new(),
            state: None,
            first_ns: None,
            keyframes_heard: 0,
        };
        observer.stage.running().unwrap();
        observer
    }

    pub fn leave(self) {
        self.stage.close().unwrap();
    }

    pub fn now_ns(&self) -> i64 {
        self.stage.clock().now_ns()
    }

    /// Process of a stage, as the register has it; `None` while it is not there.
    pub fn pid(&self, name: &str) -> Option<u64> {
        self.entry(name)
            .and_then(|(entry, lives)| lives.then_some(entry.pid))
    }

    /// How often a stage has started.
    pub fn starts(&self, name: &str) -> u64 {
        self.entry(name).map_or(0, |(entry, _)| entry.starts)
    }

    fn entry(&self, name: &str) -> Option<(randt_stage::Entry, bool)> {
        let all = Registry::all(self.stage.domain());
        all.into_iter().find(|(entry, _)| entry.name == name)
    }

    /// Listens until something is so; gives whether it came about in time.
    pub fn until(&mut self, time_max: Duration, mut is_so: impl FnMut(&Self) -> bool) -> bool {
        let end = Instant::now() + time_max;
        loop {
            self.take();
            if is_so(self) {
                return true;
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            let on: [&dyn randt_stage::Waitable; 3] = [&self.health, &self.states, &self.keyframes];
            let pause = left.min(Duration::from_millis(20));
            let reason = self.stage.wait(&on, Some(pause)).unwrap();
            assert!(reason != WakeReason::Stop, "interrupted");
        }
    }

    fn take(&mut self) {
        while let Some(received) = self.health.receive().unwrap() {
            let health = received.message().head;
            if health.state == StageState::Starting as u32 {
                continue;
            }
            let newest_ns = health.header.published_ns;
            match self.lives.iter_mut().find(|life| life.pid == health.pid) {
                Some(life) => life.newest_ns = newest_ns,
                None => self.lives.push(Life {
                    name: text_of(&health.name).to_owned(),
                    pid: health.pid,
                    started_ns: health.started_ns,
                    running_ns: newest_ns,
                    newest_ns,
                }),
            }
        }
        while let Some(received) = self.states.receive().unwrap() {
            let state = *received.message().head;
            self.first_ns.get_or_insert(state.header.stamp_ns);
            // A stage that came back sends its last ones again.
            if self.state.is_none_or(|last| state.id > last.id) {
                self.state = Some(state);
            }
        }
        while let Some(received) = self.keyframes.receive().unwrap() {
            let id = received.message().head.id;
            self.keyframes_heard = self.keyframes_heard.max(id + 1);
        }
    }

    /// Seconds of the drive so far.
    pub fn driven_s(&self) -> f64 {
        let (first, last) = (self.first_ns, self.state.map(|s| s.header.stamp_ns));
        first
            .zip(last)
            .map_or(0.0, |(first, last)| (last - first) as f64 * 1e-9)
    }

    /// Rate of turn as odometry has it, rad/s.
    pub fn turns_rad_s(&self) -> f64 {
        self.state.map_or(0.0, |state| state.velocity[2].abs())
    }

    /// When a stage first reported that it runs, in a life that came up after an instant.
    pub fn back_ns(&self, name: &str, after_ns: i64) -> Option<i64> {
        let lives = self.lives.iter().filter(|life| life.name == name);
        lives
            .map(|life| life.running_ns)
            .filter(|ns| *ns > after_ns)
            .min()
    }

    /// When a process last reported anything after an instant.
    pub fn heard_ns(&self, pid: u64, after_ns: i64) -> Option<i64> {
        let mut lives = self.lives.iter();
        lives
            .find(|life| life.pid == pid)
            .map(|life| life.newest_ns)
            .filter(|ns| *ns > after_ns)
    }

    /// From a process's beginning to its loop, the shortest of a stage's lives.
    pub fn start_up(&self, name: &str) -> Duration {
        let lives = self.lives.iter().filter(|life| life.name == name);
        let spans = lives.map(|life| life.running_ns - life.started_ns);
        Duration::from_nanos(spans.min().unwrap().unsigned_abs())
    }
}
