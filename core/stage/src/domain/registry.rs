//! Who runs: one file a stage in the domain's folder, locked while the stage lives.

use super::locks::{open_private, try_lock};
use crate::{Domain, Error};
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A process that checks whether a stage lives holds its file for microseconds; another stage of
/// that name keeps it.
const CHECKED_WITHIN: Duration = Duration::from_millis(50);
const PAUSE: Duration = Duration::from_micros(500);

/// What a stage registers about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Entry {
    /// Name such as `odometry`.
    pub name: String,
    /// Process.
    pub pid: u64,
    /// When it started, ns of the domain's clock; its epoch on the bus.
    pub started_ns: i64,
    /// How often a stage of this name has started.
    pub starts: u64,
    /// Version and commit of the program.
    pub version: String,
    /// The command that it was started with, word by word.
    #[serde(default)]
    pub command: Vec<String>,
    /// Layouts of the topics that it has opened.
    pub topics: BTreeMap<String, String>,
    /// Whether it has ended in order. One that has not ended and does not live has died.
    #[serde(default)]
    pub ended: bool,
    /// Files of shared memory that were removed or cut under it, and that it has left for new
    /// ones.
    #[serde(default)]
    pub left_files: u64,
}

/// The entry of this process. The lock goes with it.
#[derive(Debug)]
pub struct Registry {
    file: File,
    path: PathBuf,
    entry: Entry,
}

impl Registry {
    /// Enters a stage; refuses a second one of the same name.
    pub fn enter(domain: &Domain, name: &str, started_ns: i64) -> Result<Self, Error> {
        let folder = folder(domain);
        fs::create_dir_all(&folder).map_err(Error::file(&folder, "cannot be made"))?;
        let path = folder.join(format!("{name}.json"));
        let mut file = open_private(&path)?;
        let give_up = Instant::now() + CHECKED_WITHIN;
        if !try_lock(&file, &path, PAUSE, || Instant::now() < give_up)? {
            return Err(Error::RunsAlready {
                stage: name.to_owned(),
                pid: read(&mut file).unwrap_or_default().pid,
                run: domain.folder(),
            });
        }
        let last = read(&mut file).unwrap_or_default();
        let mut registry = Self {
            file,
            path,
            entry: Entry {
                name: name.to_owned(),
                pid: u64::from(std::process::id()),
                started_ns,
                starts: last.starts + 1,
                version: randt_version::VERSION.to_owned(),
                command: std::env::args_os()
                    .map(|word| word.to_string_lossy().into_owned())
                    .collect(),
                ..Entry::default()
            },
        };
        registry.write()?;
        Ok(registry)
    }

    /// What is registered.
    pub fn entry(&self) -> &Entry {
        &self.entry
    }

    /// Registers the layout of a topic.
    pub fn add_topic(&mut self, topic: &str, type_name: &str) -> Result<(), Error> {
        self.entry
            .topics
            .insert(topic.to_owned(), type_name.to_owned());
        self.write()
    }

    /// Registers that the stage ends in order.
    pub fn end(&mut self) -> Result<(), Error> {
        self.entry.ended = true;
        self.write()
    }

    /// Registers how many files it has left because they were gone.
    pub(crate) fn set_left_files(&mut self, files: u64) -> Result<(), Error> {
        self.entry.left_files = files;
        self.write()
    }

    fn write(&mut self) -> Result<(), Error> {
        let mut text = serde_json::to_string_pretty(&self.entry).unwrap_or_default();
        // In place, because another name would be another lock, and in one go: a stage that is
        // killed here must not take the count of its starts with it. Blanks cover what was there
        // before.
        let before = self.file.metadata().map_or(0, |found| found.len());
        let blanks = usize::try_from(before).unwrap_or(0);
        text.extend(std::iter::repeat_n(' ', blanks.saturating_sub(text.len())));
        let written = self.file.write_all_at(text.as_bytes(), 0);
        written.map_err(Error::file(&self.path, "cannot be written"))
    }

    /// All stages that were ever started in a domain, with whether they live.
    pub fn all(domain: &Domain) -> Vec<(Entry, bool)> {
        let Ok(files) = fs::read_dir(folder(domain)) else {
            return Vec::new();
        };
        let mut entries: Vec<_> = files
            .flatten()
            .filter_map(|found| {
                let mut file = File::open(found.path()).ok()?;
                let entry = read(&mut file)?;
                // A shared lock, so that two that check at once do not take each other for the
                // stage.
                let lives = matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
                Some((entry, lives))
            })
            .collect();
        entries.sort_by(|(a, _), (b, _)| a.name.cmp(&b.name));
        entries
    }

    /// Registers every stage that has died as one that has ended: it is not expected to come back.
    pub fn mark_dead_as_ended(domain: &Domain) -> Result<(), Error> {
        for (dead, _) in Self::all(domain).into_iter().filter(|(_, lives)| !lives) {
            let path = folder(domain).join(format!("{}.json", dead.name));
            let file = File::options()
                .write(true)
                .open(&path)
                .map_err(Error::file(&path, "cannot be opened"))?;
            // One that has just come back registers itself.
            if file.try_lock().is_ok() {
                let (path, entry) = (path, dead);
                Self { file, path, entry }.end()?;
            }
        }
        Ok(())
    }
}

fn folder(domain: &Domain) -> PathBuf {
    domain.folder().join("stages")
}

fn read(file: &mut File) -> Option<Entry> {
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_runs_once_and_its_starts_are_counted() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("registry", Some(run.path())).unwrap();
        domain.make().unwrap();
        let mut first = Registry::enter(&domain, "filter", 7).unwrap();
        first.add_topic("radar/scan/v1", "RadarScan-0").unwrap();
        let twice = Registry::enter(&domain, "filter", 8).unwrap_err();
        assert!(
            twice.to_string().contains("runs already as process"),
            "{twice}"
        );
        assert!(Registry::all(&domain)[0].1, "it lives");
        drop(first);
        let all = Registry::all(&domain);
        assert!(!all[0].0.ended, "it has died");
        Registry::mark_dead_as_ended(&domain).unwrap();
        assert!(Registry::all(&domain)[0].0.ended);
        assert!(!all[0].1 && all[0].0.topics["radar/scan/v1"] == "RadarScan-0");
        assert_eq!(
            Registry::enter(&domain, "filter", 9)
                .unwrap()
                .entry()
                .starts,
            2
        );
    }

    #[test]
    fn a_check_keeps_no_stage_from_starting() {
        let run = tempfile::tempdir().unwrap();
        let domain = Domain::new("registry", Some(run.path())).unwrap();
        domain.make().unwrap();
        let path = Registry::enter(&domain, "filter", 7).unwrap().path.clone();
        let checking = File::open(path).unwrap();
        checking.try_lock_shared().unwrap();
        let (sender, receiver) = std::sync::mpsc::channel();
        let checker = std::thread::spawn(move || {
            sender.send(()).unwrap();
            std::thread::sleep(Duration::from_millis(5));
            drop(checking);
        });
        receiver.recv().unwrap();
        assert_eq!(
            Registry::enter(&domain, "filter", 8)
                .unwrap()
                .entry()
                .starts,
            2
        );
        checker.join().unwrap();
    }
}
