//! The end of a live drive: what the stages left behind and what was seen of them.

use super::journal::HeldJournal;
use super::processes::{End, Processes};
use crate::{
    exit::Outcome,
    finish_drive::{Drive, finish_drive},
    latency::Latency,
    output::warn,
    pipeline::Pipeline,
    recovered_drive::RecoveredDrive,
    report::{self, Cost, Costs, Counters, Input},
    results::Results,
};
use anyhow::bail;
use randt_config::Config;
use randt_messages::OdometryState;
use randt_odometry::Sink;
use randt_readers::{Event, Options};
use randt_stage::Domain;
use std::path::Path;
use std::time::Instant;

/// A drive whose stages have ended.
pub struct Ending<'a> {
    pub domain: &'a Domain,
    pub out: &'a Path,
    pub config: &'a Config,
    pub use_imu: bool,
    /// What was played, and how it is read.
    pub log: Option<&'a Path>,
    pub options: Options,
}

impl Ending<'_> {
    /// Odometry's checkpoint, the ring of keyframes and the mapper's journal together are the
    /// whole drive. What of them is not there any more is counted, and the rest is written.
    pub fn finish(
        &self,
        mut processes: Processes,
        journal: HeldJournal,
        end: End,
    ) -> anyhow::Result<Outcome> {
        let mut counters = processes.counters();
        if end != End::Computed && self.log.is_some() {
            counters.add_lost("interrupted", 1, "the log was not played to its end");
        }
        if let Err(error) = journal.put_back() {
            warn(&format!("{error:#}"));
        }
        let mut results = processes.watch.take_states();
        let input = self.read_log(&mut results, &mut counters);
        let state = self.domain.state();
        let recovered = RecoveredDrive::read(self.config, self.use_imu, self.out, Some(&state));
        counters.append(recovered.counters);
        // Those that odometry has sent, and that nobody has received.
        for state in &recovered.states {
            results.state(state);
        }
        let begin = processes.begin;
        let drive = Drive {
            input,
            pipeline: recovered.pipeline,
            results,
            config: self.config,
            counters,
            published: None,
        };
        let timing = |_: &Pipeline, states: &[OdometryState]| timing(states, begin);
        match finish_drive(drive, timing, self.out)? {
            Some(shown) => Ok(Outcome::finished(shown.lost)),
            None => match processes.why() {
                Some(why) => bail!("no scan was computed; nothing was written: {why}"),
                None => bail!("no scan was computed; nothing was written"),
            },
        }
    }

    /// A second pass over the log gives the truth, which the stages never see, and what its reader
    /// counts.
    fn read_log(&self, results: &mut Results, counters: &mut Counters) -> Input {
        let Some(path) = self.log else {
            return input("live", "live", self.use_imu);
        };
        let read = self.try_read_log(path, results, counters);
        read.unwrap_or_else(|error| {
            let first = format!("its truth and its reader's counters are missing: {error:#}");
            counters.add_lost("log_gone", 1, first);
            let name = path.file_name().unwrap_or(path.as_os_str());
            input(&name.to_string_lossy(), "gone", self.use_imu)
        })
    }

    fn try_read_log(
        &self,
        path: &Path,
        results: &mut Results,
        counters: &mut Counters,
    ) -> anyhow::Result<Input> {
        let mut imu_samples = 0;
        let mut source = randt_readers::open(path, &self.options)?;
        while let Some(event) = source.next_event()? {
            match event {
                Event::Truth(truth) => results.add_truth(&truth),
                Event::Imu(_) => imu_samples += 1,
                Event::Scan(_) | Event::Twist(_) => {}
            }
        }
        counters.append(report::reader_counters(path, &source.counters()));
        let use_imu = self.use_imu && imu_samples > 0;
        report::input(source.info(), path, use_imu, imu_samples)
    }
}

fn input(name: &str, format: &'static str, imu: bool) -> Input {
    Input {
        name: name.to_owned(),
        format: format.into(),
        imu,
        ..Input::default()
    }
}

/// Times of every scan on the bus, and of the whole.
fn timing(states: &[OdometryState], begin: Instant) -> Costs {
    let latencies: Vec<Latency> = states.iter().filter_map(Latency::from_state).collect();
    let cost = |part: fn(&Latency) -> f64| {
        let times_ns = latencies.iter().map(|latency| (part(latency) * 1e6) as u64);
        Cost::from_times(&times_ns.collect::<Vec<_>>())
    };
    let run_ns = begin.elapsed().as_nanos() as u64;
    Costs::from([
        ("wait".into(), cost(|latency| latency.wait_ms)),
        ("compute".into(), cost(|latency| latency.compute_ms)),
        ("run".into(), Cost::from_times(&[run_ns])),
    ])
}
