//! Kills stages of a running pipeline and times how they come back.

use super::Random;
use super::observer::Observer;
use randt_stage::Domain;
use rustix::process::{Pid, Signal, kill_process};
use std::time::{Duration, Instant};

/// Stages that can be killed.
pub const STAGES: [&str; 3] = ["filter", "odometry", "mapper"];
/// The next fault may fall this long after the last one.
pub const APART: Duration = Duration::from_secs(5);
/// A stage is back within a second where nothing else runs; the machine of a test may be slow and
/// busy.
pub const BACK_MAX_MS: f64 = 5000.0;
/// Nothing is waited for longer.
const WAIT_MAX: Duration = Duration::from_secs(60);
/// How long a stage is stopped.
const STOP: Duration = Duration::from_secs(5);
/// How long before it is killed over what has piled up, and how soon after that, ms.
const SHORT_STOP: Duration = Duration::from_secs(3);
const CATCHING_UP_MS: usize = 60;
/// How long a turn, or a keyframe, is waited for.
pub const OCCASION_MAX: Duration = Duration::from_secs(30);
/// A turn, rad/s.
const TURN_RAD_S: f64 = 0.5;
/// Two stages die within this time.
const PAIR_MS: usize = 100;
/// A keyframe is searched for loops within this time, ms.
const LOOP_MS: usize = 15;

/// What is done to a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectedFault {
    /// Killed whenever.
    Plain,
    /// Killed while the robot turns.
    Turn,
    /// Killed just after a keyframe, in a lap that closes loops.
    Closing,
    /// Killed, and again inside the start-up window of its successor.
    StartUp,
    /// Killed together with another one.
    With(&'static str),
    /// Stopped for 5 s.
    Stop,
    /// Stopped for 3 s, and killed while it catches up.
    CatchingUp,
}

/// One fault and its outcome.
#[derive(Debug)]
pub struct Row {
    pub at_s: f64,
    pub stage: &'static str,
    pub fault: InjectedFault,
    /// Whether it hit as meant: a start-up that was over, a turn that never came.
    pub hit: bool,
    pub note: String,
    /// Until each stage that was hit was back, ms.
    pub back_ms: Vec<(&'static str, f64)>,
}

impl Row {
    /// Whether a stage died in it.
    pub fn kills(&self, stage: &str) -> bool {
        self.fault != InjectedFault::Stop && self.back_ms.iter().any(|(name, _)| *name == stage)
    }
}

/// Kills.
pub struct Killer {
    pub observer: Observer,
    pub rows: Vec<Row>,
    pub random: Random,
    /// How often each stage must have started by now.
    starts: [u64; 3],
}

impl Killer {
    pub fn enter(domain: &Domain, seed: u64) -> Self {
        let mut observer = Observer::enter(domain);
        let runs = |o: &Observer| STAGES.iter().all(|s| o.back_ns(s, 0).is_some());
        assert!(observer.until(WAIT_MAX, runs), "a stage does not run");
        println!("seed {seed}");
        println!("  drive s  stage      fault");
        Self {
            observer,
            rows: Vec::new(),
            random: Random(seed),
            starts: [1; 3],
        }
    }

    /// How many processes it has killed.
    pub fn kills(&self) -> u64 {
        self.starts.iter().map(|starts| starts - 1).sum()
    }

    /// Injects it, waits until the stage that was hit is back, and checks whether another one was
    /// disturbed.
    pub fn strike(&mut self, stage: &'static str, fault: InjectedFault) {
        let occasion = self.observer.keyframes_heard;
        let came = match fault {
            InjectedFault::Turn => self
                .observer
                .until(OCCASION_MAX, |o| o.turns_rad_s() > TURN_RAD_S),
            InjectedFault::Closing => self
                .observer
                .until(OCCASION_MAX, |o| o.keyframes_heard > occasion),
            _ => true,
        };
        let mut row = Row {
            at_s: self.observer.driven_s(),
            stage,
            fault,
            hit: came,
            note: String::new(),
            back_ms: Vec::new(),
        };
        match fault {
            InjectedFault::Plain | InjectedFault::Turn => {
                row.note = format!("at {:.2} rad/s", self.observer.turns_rad_s());
                let killed = self.kill(stage);
                self.wait_for(stage, killed, &mut row);
            }
            InjectedFault::Closing => {
                let ms = self.random.below(LOOP_MS);
                std::thread::sleep(Duration::from_millis(ms as u64));
                row.note = format!("{ms} ms after keyframe {}", self.observer.keyframes_heard);
                let killed = self.kill(stage);
                self.wait_for(stage, killed, &mut row);
            }
            InjectedFault::With(other) => {
                let ms = self.random.below(PAIR_MS);
                let killed = self.kill(stage);
                std::thread::sleep(Duration::from_millis(ms as u64));
                let other_killed = self.kill(other);
                row.note = format!("{ms} ms later the other one");
                self.wait_for(stage, killed, &mut row);
                self.wait_for(other, other_killed, &mut row);
            }
            InjectedFault::StartUp => self.strike_twice(stage, &mut row),
            InjectedFault::Stop => self.stop(stage, &mut row),
            InjectedFault::CatchingUp => {
                let pid = self.observer.pid(stage).unwrap();
                send(pid, Signal::STOP);
                self.observer.until(SHORT_STOP, |_| false);
                send(pid, Signal::CONT);
                let ms = self.random.below(CATCHING_UP_MS);
                std::thread::sleep(Duration::from_millis(ms as u64));
                row.note = format!("{ms} ms after a stop of {SHORT_STOP:?}");
                let killed = self.kill(stage);
                self.wait_for(stage, killed, &mut row);
            }
        }
        self.finish(row);
    }

    fn strike_twice(&mut self, stage: &'static str, row: &mut Row) {
        let typical = self.observer.start_up(stage);
        let first = self.observer.pid(stage);
        self.kill(stage);
        // A register that is just being written shows nobody.
        let end = Instant::now() + WAIT_MAX;
        let next = loop {
            match self.observer.pid(stage) {
                Some(pid) if Some(pid) != first => break pid,
                _ => assert!(Instant::now() < end, "{stage} is not started again"),
            }
            std::thread::sleep(Duration::from_micros(300));
        };
        // The clock of the beginning is read a moment before the register shows it.
        let micros = self.random.below(typical.as_micros() as usize * 9 / 10) as u64;
        std::thread::sleep(Duration::from_micros(micros));
        let killed = self.kill_process(stage, next);
        self.wait_for(stage, killed, row);
        // A stage that published from its loop had left the window.
        row.hit = self.observer.lives.iter().all(|life| life.pid != next);
        row.note = format!(
            "again {:.1} ms after its successor began, of {:.1}",
            micros as f64 * 1e-3,
            typical.as_secs_f64() * 1e3
        );
    }

    fn stop(&mut self, stage: &'static str, row: &mut Row) {
        let pid = self.observer.pid(stage).unwrap();
        send(pid, Signal::STOP);
        self.observer.until(STOP, |_| false);
        let continued = self.observer.now_ns();
        send(pid, Signal::CONT);
        let mut heard = None;
        self.observer.until(WAIT_MAX, |o| {
            heard = o.heard_ns(pid, continued);
            heard.is_some()
        });
        let heard = heard.unwrap_or_else(|| panic!("{stage} says nothing after it was stopped"));
        row.note = format!("for {STOP:?}");
        row.back_ms.push((stage, (heard - continued) as f64 * 1e-6));
    }

    /// Kills a stage's process; gives when.
    fn kill(&mut self, stage: &'static str) -> i64 {
        let pid = self
            .observer
            .pid(stage)
            .unwrap_or_else(|| panic!("{stage} is not there"));
        self.kill_process(stage, pid)
    }

    fn kill_process(&mut self, stage: &'static str, pid: u64) -> i64 {
        let now_ns = self.observer.now_ns();
        send(pid, Signal::KILL);
        self.starts[index(stage)] += 1;
        now_ns
    }

    fn wait_for(&mut self, stage: &'static str, killed_ns: i64, row: &mut Row) {
        let mut back = None;
        self.observer.until(WAIT_MAX, |o| {
            back = o.back_ns(stage, killed_ns);
            back.is_some()
        });
        let back = back.unwrap_or_else(|| panic!("{stage} is not back: {row:?}"));
        row.back_ms.push((stage, (back - killed_ns) as f64 * 1e-6));
    }

    fn finish(&mut self, row: Row) {
        println!(
            "{:>9.2}  {:<9}  {:?}{}, {}; back after {}",
            row.at_s,
            row.stage,
            row.fault,
            if row.hit { "" } else { " (missed)" },
            row.note,
            row.back_ms
                .iter()
                .map(|(stage, ms)| format!("{ms:.0} ms ({stage})"))
                .collect::<Vec<_>>()
                .join(", ")
        );
        for (stage, expected) in STAGES.iter().zip(self.starts) {
            let found = self.observer.starts(stage);
            assert_eq!(
                found, expected,
                "{stage} started {found} times instead of {expected}"
            );
        }
        for other in ["up", "play"] {
            assert_eq!(self.observer.starts(other), 1, "{other} was started again");
        }
        self.rows.push(row);
    }
}

fn index(stage: &str) -> usize {
    STAGES.iter().position(|name| *name == stage).unwrap()
}

fn send(pid: u64, signal: Signal) {
    let pid = Pid::from_raw(pid as i32).unwrap();
    kill_process(pid, signal).unwrap();
}
