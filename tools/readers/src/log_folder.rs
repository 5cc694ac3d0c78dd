//! Several of our logs as one: a folder of them, or a mission. A recorder begins a new file after
//! some minutes; the drive goes on.

use crate::log::LogSource;
use crate::{Counter, Error, Event, InputInfo, InputTopic, Source, counters::Counters};
use randt_log::LogReader;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A mission's folder of logs.
const MISSION_LOGS: &str = "logs";
/// Where the recorder says which part of a recording a file is.
const PART_METADATA: &str = "randt/file";

/// The logs that a path stands for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogFiles {
    /// In the order of time.
    pub files: Vec<PathBuf>,
    /// Those that cannot be read or are not there, and why: what they hold is missing.
    pub unreadable: Vec<String>,
}

/// The logs that a path stands for: a file itself; those of a folder, or of a mission, whose
/// recorder may have been stopped before it could name the last one.
pub fn log_files(path: &Path) -> Result<LogFiles, Error> {
    if !path.is_dir() {
        return Ok(LogFiles {
            files: vec![path.to_owned()],
            ..LogFiles::default()
        });
    }
    let logs = path.join(MISSION_LOGS);
    let folder = if logs.is_dir() { logs.as_path() } else { path };
    let (mut files, mut unreadable, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        if !(name.ends_with(".mcap") || name.ends_with(".mcap.active")) || !path.is_file() {
            continue;
        }
        match Beginning::read(&path) {
            Ok(Some(Beginning { first_ns, part })) => {
                files.push((first_ns, path));
                parts.extend(part);
            }
            Ok(None) => {}
            Err(why) => unreadable.push(why),
        }
    }
    files.sort();
    unreadable.extend(missing_parts(parts, folder));
    unreadable.sort();
    Ok(LogFiles {
        files: files.into_iter().map(|(_, path)| path).collect(),
        unreadable,
    })
}

/// The beginning of a log of ours.
struct Beginning {
    /// When its first message was recorded.
    first_ns: i64,
    /// Which recording it is of, by when that began, and its number in it.
    part: Option<(String, u64)>,
}

impl Beginning {
    /// `None` of another's log and of an empty one. A log of which damage leaves nothing is none of
    /// these.
    fn read(path: &Path) -> Result<Option<Self>, String> {
        let mut reader = LogReader::open(path).map_err(|error| error.to_string())?;
        let first = reader.next_entry().map_err(|error| error.to_string())?;
        let is_empty = first.is_none();
        let ours = first.filter(|first| first.channel.is_ours());
        let first_ns = ours.map(|first| first.time_ns);
        if let ([damage, ..], true) = (reader.damage(), is_empty) {
            return Err(damage.first.clone());
        }
        let part = reader.metadata(PART_METADATA).and_then(|part| {
            let number = part.get("part")?.parse().ok()?;
            Some((part.get("begun_ns")?.clone(), number))
        });
        Ok(first_ns.map(|first_ns| Self { first_ns, part }))
    }
}

/// The parts that lack between others of their recording; the oldest may have made room.
fn missing_parts(mut parts: Vec<(String, u64)>, folder: &Path) -> Vec<String> {
    parts.sort();
    let mut missing = Vec::new();
    for pair in parts.windows(2) {
        if let [(begun, last), (same, next)] = pair
            && begun == same
            && next.saturating_sub(*last) > 1
        {
            let folder = folder.display();
            missing.push(format!(
                "{folder}: of a recording there are parts {last} and {next}, and none between"
            ));
        }
    }
    missing
}

/// Logs that are read one after the other.
pub(crate) struct LogFolder {
    info: InputInfo,
    present: LogSource,
    rest: std::vec::IntoIter<PathBuf>,
    /// Of the logs that were read to their end.
    counters: Counters,
}

impl LogFolder {
    /// Opens the first of these files; `None` where there is none.
    pub fn open(logs: LogFiles, radar_required: bool) -> Result<Option<Self>, Error> {
        let LogFiles { files, unreadable } = logs;
        let mut scans = Some(0);
        let mut topics: Vec<InputTopic> = Vec::new();
        for file in &files {
            let log = LogSource::open(file, false)?;
            let both = scans.zip(log.info().scans);
            scans = both.map(|(a, b): (u64, u64)| a.saturating_add(b));
            for topic in &log.info().topics {
                match topics.iter_mut().find(|known| known.name == topic.name) {
                    Some(known) => known.messages += topic.messages,
                    None => topics.push(topic.clone()),
                }
            }
        }
        let mut rest = files.into_iter();
        let Some(first) = rest.next() else {
            return Ok(None);
        };
        if radar_required && scans == Some(0) {
            // It names what there is instead.
            LogSource::open(&first, true)?;
        }
        let present = LogSource::open(&first, false)?;
        let mut counters = Counters::default();
        for why in unreadable {
            counters.count_loss("logs_unreadable", 1, || why);
        }
        let mut info = present.info().clone();
        (info.scans, info.topics) = (scans, topics);
        Ok(Some(Self {
            info,
            present,
            rest,
            counters,
        }))
    }
}

impl Source for LogFolder {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn next_event(&mut self) -> Result<Option<Event>, Error> {
        loop {
            if let Some(event) = self.present.next_event()? {
                return Ok(Some(event));
            }
            let Some(next) = self.rest.next() else {
                return Ok(None);
            };
            let next = LogSource::open(&next, false)?;
            let (known, new) = (&self.info, next.info());
            if known.configuration != new.configuration || known.extrinsics != new.extrinsics {
                self.counters.count_event("logs_of_other_configuration", 1, || {
                    "a later file has another configuration or mounting than the first: the first one's holds".to_owned()
                });
            }
            let ended = std::mem::replace(&mut self.present, next);
            self.counters.add_all(ended.counters());
        }
    }

    fn counters(&self) -> Vec<Counter> {
        let mut counters = self.counters.clone();
        counters.add_all(self.present.counters());
        counters.list()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_lacks_between_others_is_missing() {
        let parts = |numbers: &[(&str, u64)]| {
            let parts = numbers
                .iter()
                .map(|(begun, number)| ((*begun).to_owned(), *number));
            missing_parts(parts.collect(), Path::new("logs"))
        };
        assert!(parts(&[]).is_empty());
        // Two recordings; the oldest part of one made room.
        assert!(parts(&[("7", 2), ("7", 1), ("9", 0), ("9", 1)]).is_empty());
        let missing = parts(&[("7", 3), ("7", 0), ("9", 0)]);
        assert_eq!(missing.len(), 1);
        assert!(missing[0].contains("parts 0 and 3"), "{missing:?}");
    }
}
