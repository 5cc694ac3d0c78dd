//! `randt mission list`: which missions there are.

use crate::date::Now;
use crate::earlier::JOURNAL;
use crate::exit::Outcome;
use crate::mission::Mission;
use crate::missions::Missions;
use crate::output::{json, print};
use crate::units::{bytes, count, seconds};
use serde::Serialize;
use std::fs;
use std::path::Path;

/// Arguments of `randt mission list`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// For programs
    #[arg(long)]
    json: bool,
}

/// A mission in the list.
#[derive(Debug, Serialize)]
struct Row {
    name: String,
    /// `current`, `stopped`, `interrupted` (a power cut, and it did not go on), or `broken`.
    state: &'static str,
    /// Why its record cannot be read; the other fields are then guessed from its files.
    #[serde(skip_serializing_if = "Option::is_none")]
    broken: Option<String>,
    begun_ns: i64,
    /// Its last sign of life.
    end_ns: i64,
    map_bytes: u64,
    logs: usize,
    log_bytes: u64,
}

impl Row {
    fn from_mission(mission: &Mission, is_current: bool) -> anyhow::Result<Self> {
        let size = |path: &Path| fs::metadata(path).map_or(0, |found| found.len());
        let files = mission.log_files()?;
        let stopped_ns = mission.record.stopped_ns;
        Ok(Self {
            name: mission.name(),
            state: match stopped_ns {
                _ if mission.broken.is_some() => "broken",
                Some(_) => "stopped",
                None if is_current => "current",
                None => "interrupted",
            },
            broken: mission.broken.clone(),
            begun_ns: mission.record.begun_ns,
            end_ns: stopped_ns.unwrap_or_else(|| mission.last_sign_ns()),
            map_bytes: size(&mission.folder().join(JOURNAL)),
            logs: files.len(),
            log_bytes: files.iter().map(|file| size(file)).sum(),
        })
    }
}

/// Prints them, the oldest first.
pub fn run(missions: &Missions, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let current = missions.current_or_none().map(|mission| mission.name());
    let all = missions.all()?.into_iter();
    let rows = all.map(|it| Row::from_mission(&it, current.as_ref() == Some(&it.name())));
    let rows = rows.collect::<anyhow::Result<Vec<Row>>>()?;
    if arguments.json {
        print(&json(&rows)?)?;
        return Ok(Outcome::Good);
    }
    if rows.is_empty() {
        print("no mission yet; the pipeline's start begins one\n")?;
    }
    let now_ns = Now::read().date_ns;
    for row in rows {
        print(&format!(
            "{:<24} {:<12} {:>7}, {:>7} ago  map {:>8}, {} of {}\n",
            row.name,
            row.state,
            seconds((row.end_ns - row.begun_ns).max(0) as f64 * 1e-9),
            seconds((now_ns - row.end_ns).max(0) as f64 * 1e-9),
            bytes(row.map_bytes),
            count(row.logs as u64, "log", "logs"),
            bytes(row.log_bytes),
        ))?;
        if let Some(why) = row.broken {
            print(&format!(
                "  broken: {why}; `randt mission recover` writes it anew\n"
            ))?;
        }
    }
    Ok(Outcome::Good)
}
