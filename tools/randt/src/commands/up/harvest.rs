//! The end of a drive: what the stages left behind, brought to its end as `randt run` does, and written.

use crate::{
    conclusion::Conclusion,
    exit::Outcome,
    latency::Latency,
    report::{self, Cost, Count, Input},
    results::Results,
};
use anyhow::{Context, bail};
use randt_config::Config;
use randt_mapper::Mapper;
use randt_messages::{Keyframe, MessageRef, OdometryState};
use randt_odometry::{Sink, process::Past};
use randt_readers::{Counter, Event, Options};
use randt_stage::Realm;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::time::Instant;

/// The mapper's journal in the folder of the outputs.
pub const JOURNAL: &str = "map.journal";

/// Moves the journal of an earlier drive into the same folder out of the way: a log's map begins empty.
pub fn set_aside(out: &Path) -> anyhow::Result<()> {
    let journal = out.join(JOURNAL);
    let lock = out.join(format!("{JOURNAL}.lock"));
    if File::open(&lock).is_ok_and(|lock| lock.try_lock().is_err()) {
        bail!(
            "{}: another pipeline writes its files here; give this one another --out",
            out.display()
        );
    }
    let aside = out.join(format!("{JOURNAL}.before"));
    match std::fs::rename(&journal, &aside) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("{}: cannot be set aside", journal.display()))
        }
        _ => Ok(()),
    }
}

/// A drive that is over.
pub struct Drive<'a> {
    pub realm: &'a Realm,
    pub out: &'a Path,
    pub config: &'a Config,
    pub use_imu: bool,
    /// What was played, and how it is read.
    pub log: Option<&'a Path>,
    pub options: Options,
}

/// What a second look at the log gives: the truth, which the stages never see, and what its reader says.
#[derive(Default)]
struct Log {
    imu_samples: u64,
    counters: Vec<Counter>,
    input: Option<Input>,
}

/// Times of every scan on the bus, and of the whole.
fn timing(states: &[OdometryState], begin: Instant) -> BTreeMap<&'static str, Cost> {
    let latencies: Vec<Latency> = states.iter().filter_map(Latency::of).collect();
    let cost = |part: fn(&Latency) -> f64| {
        let times_ns = latencies.iter().map(|latency| (part(latency) * 1e6) as u64);
        Cost::of(&times_ns.collect::<Vec<_>>())
    };
    BTreeMap::from([
        ("wait", cost(|latency| latency.wait_ms)),
        ("compute", cost(|latency| latency.compute_ms)),
        ("run", Cost::of(&[begin.elapsed().as_nanos() as u64])),
    ])
}

/// What odometry still has to say goes to results and map.
struct Last<'a> {
    results: &'a mut Results,
    mapper: &'a mut Mapper,
}

impl Sink for Last<'_> {
    fn state(&mut self, state: &OdometryState) {
        self.results.state(state);
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.mapper.push(keyframe);
    }
}

impl Drive<'_> {
    /// Odometry's checkpoint, the ring of keyframes and the mapper's journal together are the whole drive.
    pub fn harvest(
        &self,
        states: Vec<OdometryState>,
        extra: BTreeMap<&'static str, Count>,
        begin: Instant,
    ) -> anyhow::Result<Outcome> {
        if states.is_empty() {
            bail!("no scan was computed; nothing was written");
        }
        let mut results = Results::of(states);
        let log = self.read_log(&mut results)?;
        let (mut odometry, ring) = Past::read(self.realm, self.config, self.use_imu)?;
        let path = self.out.join(JOURNAL);
        let journal = std::fs::read(&path).with_context(|| path.display().to_string())?;
        let (mut mapper, _) = Mapper::restore(self.config, &journal)?;
        // What the mapper had no time for.
        let first = mapper.places().last().map_or(0, |p| p.keyframe_id + 1);
        let mut keyframes_lost = 0;
        for id in first..odometry.pose_record().next_keyframe {
            match ring.get(id) {
                Some(keyframe) => _ = mapper.push(keyframe.as_ref()),
                None => keyframes_lost += 1,
            }
        }
        odometry.finish(&mut Last {
            results: &mut results,
            mapper: &mut mapper,
        });
        mapper.finish();

        let name = self.log.unwrap_or(Path::new("live"));
        let mut counters = report::counters(
            name,
            &log.counters,
            &odometry.counters(),
            &mapper.counters(),
        );
        counters.extend(extra);
        if keyframes_lost > 0 {
            let first = "keyframes that neither journal nor ring has".to_owned();
            counters.insert("keyframes_lost", Count::lost(keyframes_lost, first));
        }
        let timing = timing(&results.states, begin);
        let shown = Conclusion {
            input: log.input.unwrap_or(Input {
                name: "live".to_owned(),
                format: "live",
                sha256: String::new(),
                imu: self.use_imu,
                imu_samples: 0,
            }),
            results: &results,
            mapper: &mapper,
            config: self.config,
            counters,
            timing,
            comparison: None,
        }
        .write(self.out)?;
        Ok(if shown.lost {
            Outcome::DataLost
        } else {
            Outcome::Good
        })
    }

    fn read_log(&self, results: &mut Results) -> anyhow::Result<Log> {
        let Some(path) = self.log else {
            return Ok(Log::default());
        };
        let mut log = Log::default();
        let mut source = randt_readers::open(path, &self.options)?;
        while let Some(event) = source.next_event()? {
            match event {
                Event::Truth(truth) => results.add_truth(&truth),
                Event::Imu(_) => log.imu_samples += 1,
                Event::Scan(_) => {}
            }
        }
        let use_imu = self.use_imu && log.imu_samples > 0;
        log.input = Some(report::input(
            source.info(),
            path,
            use_imu,
            log.imu_samples,
        )?);
        log.counters = source.counters();
        Ok(log)
    }
}
