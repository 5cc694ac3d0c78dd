//! One drive: all stages run, a log is played, and what can be seen from outside is noted.

use crate::support::stages::{RunFolder, Running, memory};
use randt_messages::{OdometryState, OdometryStateTopic, RadarScan, Topic};
use randt_readers::Event;
use randt_stage::{Domain, Stage};
use std::path::Path;
use std::time::{Duration, Instant};

/// How often memory is sampled.
const SAMPLE_PERIOD: Duration = Duration::from_millis(500);
/// The first scans catch up with the stages' starts; processor time and bytes are counted after
/// that.
const WARM_UP: Duration = Duration::from_secs(3);

/// The stages that compute, and the recorder where it is asked for.
pub struct Stages<'a> {
    folder: &'a RunFolder,
    pub domain: Domain,
    pub running: Vec<Running>,
}

/// What a process took while the log was played.
pub struct Cost {
    pub name: String,
    pub processor_percent: f64,
    pub written_kb_s: f64,
}

/// What was seen.
pub struct Drive {
    pub states: Vec<OdometryState>,
    pub costs: Vec<Cost>,
    /// Most bytes in use.
    pub memory: u64,
    pub scans_kb_s: f64,
}

/// Counters of a process, and when they were read.
struct Reading {
    at: Instant,
    processor: Duration,
    written: u64,
}

impl Reading {
    fn read(running: &Running) -> Self {
        Self {
            at: Instant::now(),
            processor: processor(running),
            written: running.written(),
        }
    }
}

/// Time on a processor so far.
fn processor(running: &Running) -> Duration {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", running.pid())).unwrap();
    let nanoseconds = tasks.flatten().filter_map(|task| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<u64>().ok()
    });
    Duration::from_nanos(nanoseconds.sum())
}

impl<'a> Stages<'a> {
    /// Starts them for a log; with a recorder beside them where there is a folder for it.
    pub fn start(folder: &'a RunFolder, log: &Path, prefix: &str, logs: Option<&Path>) -> Self {
        let domain = folder.domain(prefix);
        let (profile, _) = folder.profile(log);
        let start = |name, logs: Option<&Path>| {
            let mut command = RunFolder::command(&domain, name);
            command.arg("--profile").arg(&profile);
            command.args(logs.map(|_| "--out")).args(logs);
            folder.start(name, command)
        };
        let mut running: Vec<Running> = ["mapper", "odometry", "filter"]
            .map(|name| start(name, None))
            .into();
        running.extend(logs.map(|logs| start("recorder", Some(logs))));
        Self {
            folder,
            domain,
            running,
        }
    }

    /// Plays a log to its end.
    pub fn play(&self, log: &Path) -> Running {
        let mut play = RunFolder::command(&self.domain, "play");
        play.arg(log);
        self.folder.start("play", play)
    }

    /// Plays a log and watches.
    pub fn drive(&mut self, log: &Path) -> Drive {
        let mut stage = Stage::open("bench", &self.domain).unwrap();
        let mut states_in = stage.subscriber::<OdometryStateTopic>().unwrap();
        stage.running().unwrap();
        let mut play = self.play(log);
        let begin = Instant::now();
        let (mut states, mut most) = (Vec::new(), 0);
        let (mut first, mut last) = (Vec::new(), Vec::new());
        let mut looked = begin;
        while play.ended().is_none() {
            stage.wait(&[&states_in], Some(SAMPLE_PERIOD)).unwrap();
            while let Some(state) = states_in.receive().unwrap() {
                states.push(*state.message().head);
            }
            if looked.elapsed() < SAMPLE_PERIOD {
                continue;
            }
            looked = Instant::now();
            most = most.max(memory(&self.domain));
            // Counters of a process that has ended are not there any more.
            if begin.elapsed() < WARM_UP || play.ended().is_some() {
                continue;
            }
            let all = self.running.iter().chain([&play]);
            let readings: Vec<Reading> = all.map(Reading::read).collect();
            if first.is_empty() {
                first = readings;
            } else {
                last = readings;
            }
        }
        stage.close().unwrap();
        let names = self
            .running
            .iter()
            .chain([&play])
            .map(|running| &running.name);
        let costs = names.zip(first.iter().zip(&last)).map(|(name, (a, b))| {
            let seconds = b.at.duration_since(a.at).as_secs_f64();
            Cost {
                name: name.clone(),
                processor_percent: 100.0 * (b.processor - a.processor).as_secs_f64() / seconds,
                written_kb_s: (b.written - a.written) as f64 * 1e-3 / seconds,
            }
        });
        Drive {
            costs: costs.collect(),
            states,
            memory: most,
            scans_kb_s: scans_kb_s(log),
        }
    }

    /// Ends them.
    pub fn stop(&mut self) {
        for running in &mut self.running {
            let status = running.stop();
            assert!(
                status.success(),
                "randt-{}: {status}: {}",
                running.name,
                running.stderr()
            );
        }
    }
}

/// Bytes of a log's scans per second of its time, as they are on the bus.
pub fn scans_kb_s(log: &Path) -> f64 {
    let mut source = randt_readers::open(log, &randt_readers::Options::default()).unwrap();
    let (mut bytes, mut stamps) = (0, Vec::new());
    while let Some(event) = source.next_event().unwrap() {
        if let Event::Scan(scan) = event {
            bytes += size_of::<<RadarScan as Topic>::Head>() + size_of_val(scan.items.as_slice());
            stamps.push(scan.head.header.stamp_ns);
        }
    }
    let intervals = stamps.len().saturating_sub(1).max(1) as f64;
    let span_ns = stamps.last().unwrap() - stamps.first().unwrap();
    let period_s = span_ns as f64 * 1e-9 / intervals;
    bytes as f64 * 1e-3 / (stamps.len() as f64 * period_s)
}
