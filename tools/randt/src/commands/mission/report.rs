//! A mission's report: what `randt run` leaves, made of the map's journal and the poses in the logs.

use crate::conclusion::Conclusion;
use crate::latency::Latency;
use crate::mission::{CONFIGURATION, JOURNAL, Mission};
use crate::recorded::configuration;
use crate::report::{self, Cost, Count, Input};
use crate::results::Results;
use anyhow::Context;
use randt_config::Config;
use randt_log::{LogReader, Robot};
use randt_mapper::Mapper;
use randt_messages::{LogDropTopic, OdometryState, OdometryStateTopic};
use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::Path;

/// What the logs hold of a mission.
#[derive(Default)]
struct Logged {
    /// Each once, in the order in which it was recorded.
    states: Vec<OdometryState>,
    not_recorded: u64,
    unreadable: u64,
    first_unreadable: String,
}

/// Writes it into a folder. `name`: what it is called there, also while it is being copied.
pub fn write(mission: &Mission, name: &str, folder: &Path) -> anyhow::Result<()> {
    let config = configuration_of(mission)?;
    let journal = mission.folder().join(JOURNAL);
    let bytes = fs::read(&journal)
        .with_context(|| format!("{}: no keyframe was mapped", journal.display()))?;
    let (mapper, _) = Mapper::restore(&config, &bytes)?;
    let logged = Logged::of(mission)?;
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let mut counters = report::counters(
        mission.folder(),
        &[],
        &randt_odometry::Counters::default(),
        &mapper.counters(),
    );
    for (name, count, first) in [
        (
            "messages_not_recorded",
            logged.not_recorded,
            "the logs say which".to_owned(),
        ),
        (
            "logs_unreadable",
            logged.unreadable,
            logged.first_unreadable,
        ),
    ] {
        if count > 0 {
            counters.insert(name, Count::lost(count, first));
        }
    }
    let compute = logged.states.iter().filter_map(Latency::of);
    let compute_ns: Vec<u64> = compute.map(|l| (l.compute_ms * 1e6) as u64).collect();
    Conclusion {
        input: Input {
            name: name.to_owned(),
            format: "mission",
            sha256: String::new(),
            imu: logged.states.iter().any(|state| state.imu_epoch != 0),
            imu_samples: 0,
        },
        results: &Results::of(logged.states),
        mapper: &mapper,
        config: &config,
        counters,
        timing: BTreeMap::from([("compute", Cost::of(&compute_ns))]),
        comparison: None,
    }
    .write(folder)?;
    Ok(())
}

/// The one in force when the mission began.
fn configuration_of(mission: &Mission) -> anyhow::Result<Config> {
    let path = mission.folder().join(CONFIGURATION);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    configuration(Robot::default(), Some(&text)).with_context(|| path.display().to_string())
}

impl Logged {
    fn of(mission: &Mission) -> anyhow::Result<Self> {
        let mut logged = Self::default();
        let mut seen = HashSet::new();
        for file in mission.log_files()? {
            // Half a report is better than none.
            if let Err(error) = logged.add(&file, &mut seen) {
                logged.unreadable += 1;
                if logged.first_unreadable.is_empty() {
                    logged.first_unreadable = format!("{error:#}");
                }
            }
        }
        Ok(logged)
    }

    fn add(&mut self, file: &Path, seen: &mut HashSet<(u64, u64)>) -> anyhow::Result<()> {
        let mut reader = LogReader::open(file)?;
        while let Some(entry) = reader.next_entry()? {
            if let Some(state) = entry.decode::<OdometryStateTopic>()? {
                // Sent again by odometry that came back, and recorded again by the recorder that did.
                if seen.insert((state.head.scan_epoch, state.head.scan_sequence)) {
                    self.states.push(*state.head);
                }
            } else if let Some(missing) = entry.decode::<LogDropTopic>()? {
                self.not_recorded += missing.head.count;
            }
        }
        Ok(())
    }
}
