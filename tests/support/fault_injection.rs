//! What is done to a stage of a booted machine, how long it takes to come back, and whether
//! anybody else noticed.

use super::boot::Machine;
use super::watch::{Heard, Watch, now_us};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// The stages, from the sensors on.
pub const STAGES: [&str; 6] = ["radar", "imu", "filter", "odometry", "mapper", "recorder"];
/// Nothing is waited for longer.
const WAIT_MAX: Duration = Duration::from_secs(60);
/// Where nothing else runs a stage is back 0.3 s after it was started anew, 0.7 s after it was
/// killed and 1 s after its watchdog ended it; data flow two sweeps of 0.2 s later, and a hang is
/// seen by others after 2 s. The table shows it. A machine of a test may be slow and busy: what
/// must hold there is that nobody waits much longer, such as for a time-out.
const BACK_MAX_MS: f64 = 4000.0;
const FLOWS_MAX_MS: f64 = 4000.0;
const SEEN_MAX_MS: f64 = 10_000.0;

/// What is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectedFault {
    Restart,
    StopStart,
    Kill,
    Hang,
}

impl InjectedFault {
    /// Within this time a stage is back, ms: after its unit's WatchdogSec where it hangs.
    fn back_max_ms(self, watchdog_ms: f64) -> f64 {
        match self {
            Self::Restart | Self::StopStart | Self::Kill => BACK_MAX_MS,
            Self::Hang => watchdog_ms + BACK_MAX_MS,
        }
    }
}

/// One fault and its outcome.
struct Row {
    stage: &'static str,
    fault: InjectedFault,
    back_ms: f64,
    /// From being back to data that flow.
    flows_ms: f64,
    /// Until another stage's status showed it.
    seen_ms: Option<f64>,
}

impl Row {
    fn print(&self) {
        let seen = self.seen_ms.map_or(String::new(), |ms| format!("{ms:.0}"));
        let (stage, fault) = (self.stage, format!("{:?}", self.fault));
        let (back_ms, flows_ms) = (self.back_ms, self.flows_ms);
        println!("{stage:9} {fault:9} {back_ms:8.0} {flows_ms:14.0} {seen:>20}");
    }
}

/// All of them.
pub struct FaultInjector<'m> {
    machine: &'m Machine,
    watch: &'m Watch,
    rows: Vec<Row>,
}

/// Main processes by unit.
pub fn pids(machine: &Machine) -> Vec<(String, u32)> {
    let units = STAGES.map(|stage| format!("randt-{stage}.service"));
    let mut words = vec!["systemctl", "show", "--property=MainPID", "--value"];
    words.extend(units.iter().map(String::as_str));
    let text = machine.good(&words);
    let numbers = text.split_whitespace().map(|word| word.parse().unwrap());
    units.iter().cloned().zip(numbers).collect()
}

/// What shows that data flow through a stage: its own messages, or what follows from them.
fn sent_by(stage: &str) -> &str {
    match stage {
        "radar" | "imu" | "filter" | "odometry" => "state",
        "mapper" => "correction",
        _ => stage,
    }
}

impl<'m> FaultInjector<'m> {
    pub fn new(machine: &'m Machine, watch: &'m Watch) -> Self {
        println!("stage     fault       back ms  data ms later  seen by a reader ms");
        Self {
            machine,
            watch,
            rows: Vec::new(),
        }
    }

    /// Does it, waits until the stage is back and data flow, and looks whether the others are who
    /// they were.
    pub fn strike(&mut self, stage: &'static str, fault: InjectedFault) {
        let unit = format!("randt-{stage}.service");
        let before = pids(self.machine);
        let epoch_before = self.watch.epoch(sent_by(stage));
        let mut begin_us = now_us();
        let mut seen_ms = None;
        match fault {
            InjectedFault::Restart => drop(self.machine.good(&["systemctl", "restart", &unit])),
            InjectedFault::StopStart => {
                self.machine.good(&["systemctl", "stop", &unit]);
                let stopped = pids(self.machine);
                self.others_are(&stopped, &before, &unit);
                begin_us = now_us();
                self.machine.good(&["systemctl", "start", &unit]);
            }
            InjectedFault::Kill => self.signal("KILL", &unit),
            InjectedFault::Hang => {
                self.signal("STOP", &unit);
                seen_ms = self.seen(stage, begin_us);
            }
        }
        let back_us = self.back(&unit, begin_us);
        let after = pids(self.machine);
        self.others_are(&after, &before, &unit);
        let what = sent_by(stage);
        let is_other = matches!(stage, "odometry" | "mapper" | "recorder");
        let flows = |heard: &Heard| {
            let is_new = !is_other || Some(heard.epoch) != epoch_before;
            let is_whole = heard.flows || !matches!(stage, "imu" | "recorder");
            heard.what == what && is_new && is_whole
        };
        // What a stage itself sends may be there before systemd has read that it is ready.
        let from_us = if is_other { begin_us } else { back_us };
        let flows_us = self.watch.first(stage, from_us, flows).at_us;
        let row = Row {
            stage,
            fault,
            back_ms: (back_us - begin_us) as f64 * 1e-3,
            flows_ms: flows_us.saturating_sub(back_us) as f64 * 1e-3,
            seen_ms,
        };
        row.print();
        self.rows.push(row);
        // The next fault falls on a pipeline that runs.
        std::thread::sleep(Duration::from_millis(600));
    }

    fn signal(&self, signal: &str, unit: &str) {
        self.machine.good(&[
            "systemctl",
            "kill",
            "--kill-who=main",
            "--signal",
            signal,
            unit,
        ]);
    }

    /// When a unit was active again, microseconds.
    fn back(&self, unit: &str, begin_us: u64) -> u64 {
        let begin = Instant::now();
        loop {
            let text = self.machine.good(&[
                "systemctl",
                "show",
                "--property=ActiveState,ActiveEnterTimestampMonotonic",
                unit,
            ]);
            let value = |name: &str| text.lines().find_map(|line| line.strip_prefix(name));
            let entered_us = value("ActiveEnterTimestampMonotonic=")
                .unwrap()
                .parse()
                .unwrap();
            if value("ActiveState=") == Some("active") && entered_us > begin_us {
                return entered_us;
            }
            assert!(
                begin.elapsed() < WAIT_MAX,
                "{unit} did not come back: {text}"
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn others_are(&self, now: &[(String, u32)], before: &[(String, u32)], unit: &str) {
        for (now, before) in now.iter().zip(before) {
            assert!(
                now == before || now.0 == unit,
                "{unit} was hit: {now:?} was {before:?}: {}",
                self.machine.journal(&now.0, &["--lines", "20"])
            );
        }
    }

    /// How long it took until another stage's status showed that a stage hangs. No stage reads
    /// what the recorder writes.
    fn seen(&self, stage: &str, begin_us: u64) -> Option<f64> {
        let (by, words) = match stage {
            "radar" | "filter" => ("odometry", "stale: no scan for "),
            "imu" => ("odometry", "no IMU sample for "),
            "odometry" => ("recorder", "no pose for "),
            "mapper" => ("odometry", "no mapper status for "),
            _ => return None,
        };
        let begin = Instant::now();
        let mut status = String::new();
        while begin.elapsed() < WAIT_MAX {
            status = self.machine.status(&format!("randt-{by}"));
            if status.contains(words) {
                return Some((now_us() - begin_us) as f64 * 1e-3);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("randt-{by} did not see that {stage} hangs: {status}");
    }

    /// Whether all came back in time, and the trajectory went on.
    pub fn check(&self) {
        self.trajectory();
        for row in &self.rows {
            let (stage, fault) = (row.stage, row.fault);
            assert!(
                row.back_ms < fault.back_max_ms(self.watchdog_ms(stage)),
                "{stage} {fault:?}: {} ms",
                row.back_ms
            );
            assert!(
                row.flows_ms < FLOWS_MAX_MS,
                "{stage} {fault:?}: {} ms",
                row.flows_ms
            );
            assert!(
                row.seen_ms.is_none_or(|ms| ms < SEEN_MAX_MS),
                "{stage}: {:?}",
                row.seen_ms
            );
        }
    }

    fn watchdog_ms(&self, stage: &str) -> f64 {
        let unit = format!("randt-{stage}");
        let text = self.machine.property(&unit, "WatchdogUSec");
        let seconds = text.strip_suffix('s').and_then(|text| text.parse().ok());
        seconds.map_or_else(|| panic!("{unit}: {text}"), |s: f64| s * 1e3)
    }

    /// Every scan of a radar's process has its pose, each one the next, in one frame: only with
    /// the radar scans can be missed.
    fn trajectory(&self) {
        let states = self.watch.states();
        for (before, state) in states.iter().zip(states.iter().skip(1)) {
            assert_eq!(state.id, before.id + 1, "{before:?}, {state:?}");
            if state.scan_epoch == before.scan_epoch {
                let next = (before.odom_frame_id, before.scan_sequence + 1);
                let is = (state.odom_frame_id, state.scan_sequence);
                assert_eq!(is, next, "{before:?}, {state:?}");
            }
        }
        assert!(states.len() > 100, "{} poses", states.len());
        let frames: BTreeSet<u64> = states.iter().map(|state| state.odom_frame_id).collect();
        println!("{} poses in a row, in frames {frames:?}", states.len());
    }
}
