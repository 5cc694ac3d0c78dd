//! A mission: the folder of one drive, with its map, its logs, its configuration and its report.
//!
//! Responsible for what a mission is and how it goes on or ends. Not responsible for which one is
//! the current one (`missions`), nor for the stages that write into it.

mod record;

use crate::date::Now;
use crate::earlier::JOURNAL;
use crate::output::{json, warn, write_whole};
use crate::plain_file;
use anyhow::{Context, ensure};
use randt_odometry::runtime::RECORDS;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

pub use record::Record;

/// The configuration in force when it began or went on.
pub const CONFIGURATION: &str = "config.toml";
/// What was made of it when it was stopped.
pub const REPORT: &str = "report";
/// The recorder's folder.
const LOGS: &str = "logs";
/// What odometry left in memory, where that was about to be taken away before there was a report.
const STATE: &str = "state";
/// A mission that was not stopped goes on if its last sign of life is no older than this: somebody
/// has changed the battery. After a longer pause the robot may stand in another building.
const PAUSE_MAX_NS: i64 = 600_000_000_000;

/// A mission on the disk.
#[derive(Clone, Debug)]
pub struct Mission {
    folder: PathBuf,
    /// Its record.
    pub record: Record,
    /// Why its record cannot be read, where that is so; the record is then made from the files.
    pub broken: Option<String>,
}

impl Mission {
    /// Makes a new one. The folder must not be there yet.
    pub fn begin(folder: &Path, number: u64, date_ns: i64, now: &Now) -> anyhow::Result<Self> {
        let context = || format!("{}: cannot be made", folder.display());
        fs::create_dir(folder).with_context(context)?;
        fs::create_dir(folder.join(LOGS)).with_context(context)?;
        let mission = Self {
            folder: folder.to_owned(),
            record: Record {
                randt: randt_version::VERSION.to_owned(),
                number,
                begun_ns: date_ns,
                boot: Some(now.boot.clone()),
                ..Record::default()
            },
            broken: None,
        };
        mission.save()?;
        Ok(mission)
    }

    /// Reads one. A folder that has something of a mission is one, even without a readable record.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let names = [record::FILE, LOGS, JOURNAL];
        let has_any = names.iter().any(|name| folder.join(name).exists());
        ensure!(has_any, "{}: is no mission", folder.display());
        let read = Record::read(folder);
        let mut mission = Self {
            folder: folder.to_owned(),
            broken: read.as_ref().err().map(|error| format!("{error:#}")),
            record: read.unwrap_or_default(),
        };
        if mission.broken.is_some() {
            mission.record = mission.guess();
        }
        Ok(mission)
    }

    /// A lost record, guessed from the files.
    fn guess(&self) -> Record {
        let report = self.folder.join(REPORT).join("report.json");
        let mut files = self.files();
        files.push(self.folder.join(CONFIGURATION));
        let written_ns = files.iter().filter_map(|file| modified_ns(file));
        Record {
            begun_ns: written_ns.min().unwrap_or(0),
            stopped_ns: modified_ns(&report),
            ..Record::default()
        }
    }

    /// Writes a record that cannot be read anew, of what is there. What stood in its place is
    /// kept.
    pub fn repair(&mut self) -> anyhow::Result<()> {
        let Some(why) = self.broken.take() else {
            return Ok(());
        };
        let kept = record::keep_broken(&self.folder)?;
        self.save()?;
        let kept = kept.map_or(String::new(), |kept| {
            format!("; what was there is kept as {kept}")
        });
        warn(&format!("{}: {why}; it is written anew{kept}", self.name()));
        Ok(())
    }

    fn save(&self) -> anyhow::Result<()> {
        let text = json(&self.record)?;
        write_whole(&self.folder.join(record::FILE), text.as_bytes())
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

    /// Whether a mapper writes its map at this moment.
    pub fn is_written(&self) -> bool {
        let lock = plain_file::open(&self.folder.join(format!("{JOURNAL}.lock")));
        lock.is_ok_and(|lock| lock.try_lock().is_err())
    }

    /// How long it has been silent, ns, at most; `None` where that is unknown: the machine was
    /// started anew, and its date has no source, or the date is before the last sign of life.
    pub fn silent_ns(&self, now: &Now) -> Option<i64> {
        let boot = self.record.boot.as_ref();
        let in_boot = boot.and_then(|boot| now.since_ns(boot));
        let by_date = now.date_ns - self.last_sign_ns();
        let is_believed = by_date >= 0 && (now.is_date_known || in_boot.is_some());
        [in_boot, is_believed.then_some(by_date)]
            .into_iter()
            .flatten()
            .min()
    }

    /// Whether it is to go on when the robot starts: it was interrupted, and surely not long ago.
    pub fn goes_on(&self, now: &Now) -> bool {
        let is_recent = self.silent_ns(now).is_some_and(|ns| ns <= PAUSE_MAX_NS);
        self.record.stopped_ns.is_none() && is_recent
    }

    /// When something was last written, ns since 1970.
    pub fn last_sign_ns(&self) -> i64 {
        let files = self.files();
        let written_ns = files.iter().filter_map(|file| modified_ns(file));
        written_ns.max().unwrap_or(self.record.begun_ns)
    }

    /// What shows when it was alive.
    fn files(&self) -> Vec<PathBuf> {
        let mut files = self.log_files().unwrap_or_default();
        files.extend([JOURNAL, record::FILE].map(|name| self.folder.join(name)));
        files
    }

    /// Records that it goes on. `has_memory`: whether what the stages had in memory is there.
    pub fn resume(&mut self, now: &Now, has_memory: bool) -> anyhow::Result<()> {
        self.repair()?;
        self.record.resumed_ns.push(now.date_ns);
        let has_driven = self.folder.join(JOURNAL).exists() || !self.log_files()?.is_empty();
        self.record.power_cuts += u64::from(has_driven && !has_memory);
        self.record.boot = Some(now.boot.clone());
        self.save()
    }

    /// Records that it is over.
    pub fn stop(&mut self, date_ns: i64) -> anyhow::Result<()> {
        self.repair()?;
        self.record.stopped_ns = Some(date_ns);
        self.save()
    }

    /// Whether its report is there.
    pub fn has_report(&self) -> bool {
        self.folder.join(REPORT).join("report.json").is_file()
    }

    /// Where odometry's last state was kept, if it was.
    pub fn kept_state(&self) -> Option<PathBuf> {
        let kept = self.folder.join(STATE);
        kept.is_dir().then_some(kept)
    }

    /// Keeps odometry's last state, which is about to be taken away.
    pub fn keep_state(&self, from: &Path) -> anyhow::Result<()> {
        let kept = self.folder.join(STATE);
        let there = RECORDS.map(|name| (from.join(name), kept.join(name)));
        for (from, to) in there.iter().filter(|(from, _)| from.is_file()) {
            fs::create_dir_all(&kept).with_context(|| kept.display().to_string())?;
            fs::copy(from, to).with_context(|| format!("{}: cannot be kept", from.display()))?;
        }
        Ok(())
    }

    /// What odometry left is in the report now.
    pub fn drop_state(&self) -> anyhow::Result<()> {
        match self.kept_state() {
            Some(kept) => fs::remove_dir_all(&kept).with_context(|| kept.display().to_string()),
            None => Ok(()),
        }
    }

    /// Its logs, finished and not, in the order of time.
    pub fn log_files(&self) -> anyhow::Result<Vec<PathBuf>> {
        let folder = self.logs();
        let found = match fs::read_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            found => found.with_context(|| folder.display().to_string())?,
        };
        // Plain ones: of a pipe it would be waited for a writer.
        let is_plain = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_file());
        let plain = found.flatten().filter(is_plain);
        let mut files: Vec<PathBuf> = plain.map(|entry| entry.path()).collect();
        files.retain(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.contains(".mcap")
        });
        files.sort();
        Ok(files)
    }
}

fn modified_ns(path: &Path) -> Option<i64> {
    let modified = fs::metadata(path).ok()?.modified().ok()?;
    let since = modified.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_nanos()).ok()
}

#[cfg(test)]
mod tests;
