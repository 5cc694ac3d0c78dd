//! Who runs: one file a stage in the realm's folder, locked while the stage lives.

use crate::{Error, Realm};
use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::PathBuf;

/// What a stage says of itself to those who cannot ask it.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Entry {
    /// Name such as `odometry`.
    pub name: String,
    /// Process.
    pub pid: u64,
    /// When it started, ns of the realm's clock; its epoch on the bus.
    pub started_ns: i64,
    /// How often a stage of this name has started.
    pub starts: u64,
    /// Version of the program.
    pub version: String,
    /// Layouts of the topics that it has opened.
    pub topics: BTreeMap<String, String>,
    /// Shared memory that its topics take while every reader keeps up, bytes: in use already or not.
    #[serde(default)]
    pub needs_bytes: u64,
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
    pub fn enter(realm: &Realm, name: &str, started_ns: i64) -> Result<Self, Error> {
        let folder = folder(realm);
        fs::create_dir_all(&folder).map_err(Error::file(&folder, "cannot be made"))?;
        let path = folder.join(format!("{name}.json"));
        let mut file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path)
            .map_err(Error::file(&path, "cannot be opened"))?;
        let last = read(&mut file).unwrap_or_default();
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::RunsAlready {
                    stage: name.to_owned(),
                    pid: last.pid,
                    run: realm.folder(),
                });
            }
            Err(TryLockError::Error(cause)) => {
                return Err(Error::file(path, "cannot be locked")(cause));
            }
        }
        let mut registry = Self {
            file,
            path,
            entry: Entry {
                name: name.to_owned(),
                pid: u64::from(std::process::id()),
                started_ns,
                starts: last.starts + 1,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                topics: BTreeMap::new(),
                needs_bytes: 0,
            },
        };
        registry.write()?;
        Ok(registry)
    }

    /// What is written.
    pub fn entry(&self) -> &Entry {
        &self.entry
    }

    /// Notes the layout of a topic.
    pub fn add_topic(&mut self, topic: &str, type_name: &str) -> Result<(), Error> {
        self.entry
            .topics
            .insert(topic.to_owned(), type_name.to_owned());
        self.write()
    }

    /// Notes how much shared memory this stage will have in use.
    pub fn set_needs(&mut self, bytes: u64) -> Result<(), Error> {
        self.entry.needs_bytes = bytes;
        self.write()
    }

    fn write(&mut self) -> Result<(), Error> {
        let text = serde_json::to_string_pretty(&self.entry).unwrap_or_default();
        let file = &mut self.file;
        // In place: another name would be another lock. Whoever reads half of it reads again later.
        let written = file
            .set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| file.write_all(text.as_bytes()));
        written.map_err(Error::file(&self.path, "cannot be written"))
    }

    /// All stages that were ever started in a realm, with whether they live.
    pub fn all(realm: &Realm) -> Vec<(Entry, bool)> {
        let Ok(files) = fs::read_dir(folder(realm)) else {
            return Vec::new();
        };
        let mut entries: Vec<_> = files
            .flatten()
            .filter_map(|found| {
                let mut file = File::open(found.path()).ok()?;
                let entry = read(&mut file)?;
                // A shared lock, so that two who look do not take each other for the stage.
                let lives = matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
                Some((entry, lives))
            })
            .collect();
        entries.sort_by(|(a, _), (b, _)| a.name.cmp(&b.name));
        entries
    }
}

fn folder(realm: &Realm) -> PathBuf {
    realm.folder().join("stages")
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
        let realm = Realm::new("registry", Some(run.path())).unwrap();
        realm.make().unwrap();
        let mut first = Registry::enter(&realm, "filter", 7).unwrap();
        first.add_topic("radar/scan/v1", "RadarScan-0").unwrap();
        let twice = Registry::enter(&realm, "filter", 8).unwrap_err();
        assert!(
            twice.to_string().contains("runs already as process"),
            "{twice}"
        );
        assert!(Registry::all(&realm)[0].1, "it lives");
        drop(first);
        let all = Registry::all(&realm);
        assert!(!all[0].1 && all[0].0.topics["radar/scan/v1"] == "RadarScan-0");
        assert_eq!(
            Registry::enter(&realm, "filter", 9).unwrap().entry().starts,
            2
        );
    }
}
