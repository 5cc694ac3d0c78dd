//! A mission: the folder of one drive, with its map, its logs, its configuration and its report.
//!
//! Responsible for what a mission is and how it goes on or ends. Not responsible for which one is the current one
//! (`missions`), nor for the stages that write into it.

use crate::output::write_whole;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// The mapper's journal.
pub const JOURNAL: &str = "map.journal";
/// The configuration in force when it began or went on.
pub const CONFIGURATION: &str = "config.toml";
/// What was made of it when it was stopped.
pub const REPORT: &str = "report";
/// The recorder's folder.
const LOGS: &str = "logs";
/// What the mission says of itself.
const RECORD: &str = "mission.json";
/// A mission that was not stopped goes on if its last sign of life is no older than this: somebody has changed the
/// battery. After a longer pause the robot may stand in another building.
const PAUSE_MAX_NS: i64 = 600_000_000_000;

/// What `mission.json` says.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq, Eq)]
pub struct Record {
    /// Version of the program that began it.
    pub randt: String,
    /// When it began, ns since 1970 of the system's clock.
    pub begun_ns: i64,
    /// When it was stopped; not for one that runs, or that a power cut ended.
    pub stopped_ns: Option<i64>,
    /// When it went on after it had been interrupted.
    pub resumed_ns: Vec<i64>,
}

/// A mission on the disk.
#[derive(Clone, Debug)]
pub struct Mission {
    folder: PathBuf,
    /// What it says of itself.
    pub record: Record,
}

impl Mission {
    /// Makes a new one. The folder must not be there yet.
    pub fn begin(folder: &Path, now_ns: i64) -> anyhow::Result<Self> {
        let said = || format!("{}: cannot be made", folder.display());
        fs::create_dir(folder).with_context(said)?;
        fs::create_dir(folder.join(LOGS)).with_context(said)?;
        let mission = Self {
            folder: folder.to_owned(),
            record: Record {
                randt: env!("CARGO_PKG_VERSION").to_owned(),
                begun_ns: now_ns,
                ..Record::default()
            },
        };
        mission.save()?;
        Ok(mission)
    }

    /// Reads one.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(RECORD);
        let text = fs::read_to_string(&path)
            .with_context(|| format!("{}: is no mission", folder.display()))?;
        let record = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        Ok(Self {
            folder: folder.to_owned(),
            record,
        })
    }

    fn save(&self) -> anyhow::Result<()> {
        let mut text = serde_json::to_string_pretty(&self.record)?;
        text.push('\n');
        write_whole(&self.folder.join(RECORD), text.as_bytes())
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Its folder's name.
    pub fn name(&self) -> String {
        let name = self.folder.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    /// Where its logs are.
    pub fn logs(&self) -> PathBuf {
        self.folder.join(LOGS)
    }

    /// Whether it is to go on when the robot starts: it was interrupted, and not long ago. A clock that has not been set
    /// yet reads a time before that.
    pub fn goes_on(&self, now_ns: i64) -> bool {
        self.record.stopped_ns.is_none() && now_ns - self.last_sign_ns() <= PAUSE_MAX_NS
    }

    /// When something was last written, ns since 1970.
    pub fn last_sign_ns(&self) -> i64 {
        let files = self.log_files().unwrap_or_default().into_iter();
        let files = files.chain([self.folder.join(JOURNAL), self.folder.join(RECORD)]);
        let modified_ns = |path: PathBuf| {
            let modified = fs::metadata(path).ok()?.modified().ok()?;
            let since = modified.duration_since(UNIX_EPOCH).ok()?;
            i64::try_from(since.as_nanos()).ok()
        };
        let newest = files.filter_map(modified_ns).max();
        newest.unwrap_or(self.record.begun_ns)
    }

    /// Notes that it goes on.
    pub fn resume(&mut self, now_ns: i64) -> anyhow::Result<()> {
        self.record.resumed_ns.push(now_ns);
        self.save()
    }

    /// Notes that it is over.
    pub fn stop(&mut self, now_ns: i64) -> anyhow::Result<()> {
        self.record.stopped_ns = Some(now_ns);
        self.save()
    }

    /// Its logs, finished and not, in the order of time.
    pub fn log_files(&self) -> anyhow::Result<Vec<PathBuf>> {
        let folder = self.logs();
        let found = match fs::read_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            found => found.with_context(|| folder.display().to_string())?,
        };
        let mut files: Vec<PathBuf> = found.flatten().map(|entry| entry.path()).collect();
        files.retain(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.contains(".mcap")
        });
        files.sort();
        Ok(files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;

    fn now_ns() -> i64 {
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap()
            .as_nanos() as i64
    }

    #[test]
    fn it_goes_on_after_a_short_interruption_only() {
        let folder = tempfile::tempdir().unwrap();
        let now_ns = now_ns();
        let mut mission = Mission::begin(&folder.path().join("a"), now_ns).unwrap();
        assert!(mission.goes_on(now_ns + 590_000_000_000));
        assert!(!mission.goes_on(now_ns + 620_000_000_000));
        // The clock is not set yet.
        assert!(mission.goes_on(0));
        mission.resume(now_ns + 1).unwrap();
        mission.stop(now_ns + 2).unwrap();
        assert!(!mission.goes_on(now_ns + 3));
        let read = Mission::open(mission.folder()).unwrap();
        assert_eq!(read.record, mission.record);
        assert_eq!(read.record.resumed_ns, [now_ns + 1]);
    }

    #[test]
    fn what_is_no_mission_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let text = format!("{:#}", Mission::open(folder.path()).unwrap_err());
        assert!(text.contains("is no mission"), "{text}");
        fs::write(folder.path().join("mission.json"), "{\"randt\": 5}").unwrap();
        let text = format!("{:#}", Mission::open(folder.path()).unwrap_err());
        assert!(text.contains("mission.json"), "{text}");
    }
}
