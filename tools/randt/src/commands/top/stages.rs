//! The stages, by the register, their own reports and the kernel together.

use super::snapshot::StageRow;
use crate::process::Sample;
use randt_messages::{StageHealth, StageState, health::text_of};
use randt_stage::Entry;
use std::collections::BTreeMap;

/// A stage reports twice a second; one that is silent for this time hangs.
const HANGS_NS: i64 = 1_000_000_000;
/// ... and one of another machine is away: its reports come over a radio.
const HANGS_ELSEWHERE_NS: i64 = 3_000_000_000;

/// The last reports and samples of all stages.
#[derive(Debug, Default)]
pub struct Stages {
    /// By name and epoch.
    health: BTreeMap<(String, u64), StageHealth>,
    /// By process.
    samples: BTreeMap<u64, Sample>,
}

impl Stages {
    /// Takes the report of a stage.
    pub fn push(&mut self, health: &StageHealth) {
        let key = (text_of(&health.name).to_owned(), health.header.epoch);
        self.health.insert(key, *health);
    }

    /// The rows of the register. `now_ns`: of the domain's clock, where there is a connection to
    /// it.
    pub fn rows(&mut self, register: &[(Entry, bool)], now_ns: Option<i64>) -> Vec<StageRow> {
        let epoch = |entry: &Entry| entry.started_ns.unsigned_abs();
        self.health.retain(|(name, of_epoch), _| {
            let current = |entry: &Entry| entry.name == *name && epoch(entry) == *of_epoch;
            let mut named = register.iter().filter(|(entry, _)| entry.name == *name);
            // One that is in no register is another machine's: the link brings its reports.
            named.clone().next().is_none() || named.any(|(entry, _)| current(entry))
        });
        let mut samples = BTreeMap::new();
        let rows = register
            .iter()
            .map(|(entry, lives)| {
                let word = self.health.get(&(entry.name.clone(), epoch(entry)));
                let sample = lives.then(|| Sample::read(entry.pid)).flatten();
                let earlier = self.samples.get(&entry.pid);
                let silent_ns = word.zip(now_ns);
                let silent_ns = silent_ns.map(|(word, now_ns)| now_ns - word.header.stamp_ns);
                let (state, message) = state(entry, sample.as_ref(), word, silent_ns);
                if let Some(sample) = sample {
                    samples.insert(entry.pid, sample);
                }
                StageRow {
                    name: entry.name.clone(),
                    pid: entry.pid,
                    state,
                    epoch: epoch(entry),
                    restarts: entry.starts.saturating_sub(1),
                    cpu_percent: sample.zip(earlier).and_then(|(now, e)| now.cpu_percent(e)),
                    rss_bytes: sample.map(|sample| sample.rss_bytes),
                    lost: word.map_or(0, |word| word.lost),
                    message,
                }
            })
            .collect::<Vec<_>>();
        self.samples = samples;
        let is_here = |name: &str| register.iter().any(|(entry, _)| entry.name == name);
        let mut elsewhere = BTreeMap::new();
        for ((name, _), word) in &self.health {
            let newest = elsewhere.entry(name.as_str()).or_insert(word);
            if word.header.published_ns > newest.header.published_ns {
                *newest = word;
            }
        }
        elsewhere.retain(|name, _| !is_here(name));
        let elsewhere = elsewhere.into_iter();
        rows.into_iter()
            .chain(elsewhere.map(|(name, word)| row_elsewhere(name, word, now_ns)))
            .collect()
    }
}

/// A stage of another machine, as it reports itself. Its clock is that machine's, so its age counts
/// from when its report was published here.
fn row_elsewhere(name: &str, word: &StageHealth, now_ns: Option<i64>) -> StageRow {
    let silent_ns = now_ns.map_or(0, |now_ns| now_ns - word.header.published_ns);
    let (state, message) = match silent_ns > HANGS_ELSEWHERE_NS {
        true => (
            StageState::Degraded.as_str(),
            format!("no report came for {:.0} s", silent_ns as f64 * 1e-9),
        ),
        false => (
            StageState::from_code(word.state).as_str(),
            text_of(&word.message).to_owned(),
        ),
    };
    StageRow {
        name: name.to_owned(),
        pid: word.pid,
        state,
        epoch: word.header.epoch,
        restarts: word.restarts,
        cpu_percent: None,
        rss_bytes: None,
        lost: word.lost,
        message,
    }
}

/// State and message of a stage. `sample`: of its process, where it lives.
fn state(
    entry: &Entry,
    sample: Option<&Sample>,
    word: Option<&StageHealth>,
    silent_ns: Option<i64>,
) -> (&'static str, String) {
    let Some(sample) = sample else {
        return if entry.ended {
            (StageState::Finished.as_str(), String::new())
        } else {
            ("dead", format!("died as process {}", entry.pid))
        };
    };
    let message = word.map_or("", |word| text_of(&word.message)).to_owned();
    if sample.stopped {
        return ("stopped", format!("kill -CONT {} lets it go on", entry.pid));
    }
    if let Some(silent_ns) = silent_ns.filter(|silent_ns| *silent_ns > HANGS_NS) {
        let message = format!("has reported nothing for {:.1} s", silent_ns as f64 * 1e-9);
        return (StageState::Degraded.as_str(), message);
    }
    let state = word.map(|word| StageState::from_code(word.state));
    (state.unwrap_or(StageState::Starting).as_str(), message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_messages::health::fixed_text;

    fn entry(ended: bool) -> Entry {
        Entry {
            name: "filter".to_owned(),
            // This process: one that surely lives.
            pid: u64::from(std::process::id()),
            started_ns: 7,
            starts: 3,
            ended,
            ..Entry::default()
        }
    }

    fn word(state: StageState, message: &str) -> StageHealth {
        let mut health = StageHealth {
            name: fixed_text("filter"),
            message: fixed_text(message),
            state: state as u32,
            ..StageHealth::default()
        };
        health.header.epoch = 7;
        health
    }

    #[test]
    fn a_stage_is_what_it_reports_unless_it_cannot_report() {
        let mut stages = Stages::default();
        let mut row = |register: (Entry, bool), now_ns| {
            let mut rows = stages.rows(&[register], now_ns);
            let row = rows.pop().unwrap();
            (row.state, row.message)
        };
        assert_eq!(row((entry(false), true), Some(0)).0, "starting");
        assert_eq!(row((entry(false), false), Some(0)).0, "dead");
        assert_eq!(row((entry(true), false), None), ("finished", String::new()));

        stages.push(&word(StageState::Degraded, "scans that do not fit"));
        let mut row = |now_ns| {
            stages
                .rows(&[(entry(false), true)], Some(now_ns))
                .pop()
                .unwrap()
        };
        let now = row(1_000_000_000);
        assert_eq!((now.state, now.restarts, now.epoch), ("degraded", 2, 7));
        assert_eq!(now.message, "scans that do not fit");
        assert_eq!(row(5_000_000_000).message, "has reported nothing for 5.0 s");
        assert!(row(6_000_000_000).cpu_percent.is_some());
    }

    #[test]
    fn a_stage_of_another_machine_is_what_its_last_report_says() {
        let mut stages = Stages::default();
        let mut report = word(StageState::Running, "");
        for (epoch, published_ns) in [(9, 10), (8, 1_000_000_000)] {
            (report.header.epoch, report.header.published_ns) = (epoch, published_ns);
            stages.push(&report);
        }
        let rows = stages.rows(&[], Some(2_000_000_000));
        assert_eq!(
            (rows.len(), rows[0].state, rows[0].epoch),
            (1, "running", 8)
        );
        let rows = stages.rows(&[], Some(9_000_000_000));
        assert_eq!(rows[0].message, "no report came for 8 s");
    }
}
