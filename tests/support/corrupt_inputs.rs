//! Runs of inputs that are not as they should be, and what holds for every one of them.

use super::{Ended, OUTPUTS, Row, drive, names, report, run, tum};
use randt_messages::{Message, RadarScan};
use randt_simulator::Event;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Scans of the drive that is corrupted: 2.5 s of standstill, then 5.5 s on the way.
pub const SCANS: usize = 40;
/// The scan at which things go wrong: on the way, with as many before as after.
pub const BAD: usize = 20;

pub static DRIVE: LazyLock<Vec<Event>> = LazyLock::new(|| drive::events(SCANS as u64));

/// A run and what it left.
pub struct Ran {
    pub ended: Ended,
    pub out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Ran {
    pub fn code(&self) -> i32 {
        self.ended.code.unwrap()
    }

    pub fn rows(&self) -> Vec<Row> {
        tum(&self.out.join("odometry.tum"))
    }

    pub fn counter(&self, name: &str) -> u64 {
        report(&self.out)["counters"][name]["count"]
            .as_u64()
            .unwrap_or(0)
    }

    /// Number of odometry frames.
    pub fn frames(&self) -> usize {
        self.rows().chunk_by(|a, b| a.frame == b.frame).count()
    }

    /// It finished with data lost, or without loss, and has a pose for that many scans.
    #[track_caller]
    pub fn finished(&self, code: i32, scans: usize) -> &Self {
        let Ended { stdout, stderr, .. } = &self.ended;
        assert_eq!(self.code(), code, "{stdout}{stderr}");
        assert_eq!(self.rows().len(), scans, "{stdout}{stderr}");
        self
    }

    #[track_caller]
    pub fn refused(&self, code: i32, words: &[&str]) -> &Self {
        assert_eq!(self.code(), code, "{}", self.ended.stderr);
        for words in words {
            assert!(
                self.ended.stderr.contains(words),
                "no {words:?} in: {}",
                self.ended.stderr
            );
        }
        self
    }
}

/// Runs an input and checks what holds for every one.
#[track_caller]
pub fn checked(input: &Path, more: &[&str]) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let ended = run(input, &out, more);
    let text = format!("{}{}", ended.stdout, ended.stderr);
    let code = ended
        .code
        .unwrap_or_else(|| panic!("{}: killed by a signal: {text}", input.display()));
    assert!([0, 1, 2, 3, 78].contains(&code), "exit code {code}: {text}");
    assert!(!ended.stderr.contains("panicked"), "{text}");
    // Whole files under their names or none at all, and nothing left lying about.
    let finished = code == 0 || code == 3;
    assert_eq!(
        names(&out),
        if finished { OUTPUTS.to_vec() } else { vec![] },
        "{text}"
    );
    let name = input.file_name().unwrap().to_str().unwrap();
    assert!(
        [0, 2, 78].contains(&code) || ended.stderr.contains(name),
        "{name} is not named: {text}"
    );
    if finished {
        let plot = fs::read_to_string(out.join("plot.svg")).unwrap();
        assert!(plot.trim_end().ends_with("</svg>"), "the picture is whole");
        // Every scan has a live pose and a final one.
        let [live, last] = ["odometry.tum", "trajectory.tum"].map(|name| tum(&out.join(name)));
        let stamps = |rows: &[Row]| rows.iter().map(|row| row.stamp_ns).collect::<Vec<_>>();
        assert_eq!(stamps(&live), stamps(&last));
    }
    Ran {
        ended,
        out,
        _folder: folder,
    }
}

/// Runs the simulated drive after it was corrupted.
#[track_caller]
pub fn corrupted(corrupt: impl FnOnce(&mut Vec<Event>)) -> Ran {
    corrupted_with(&[], corrupt)
}

#[track_caller]
pub fn corrupted_with(more: &[&str], corrupt: impl FnOnce(&mut Vec<Event>)) -> Ran {
    let mut events = DRIVE.clone();
    corrupt(&mut events);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&events, &log);
    checked(&log, more)
}

/// The index of a scan among the events.
pub fn scan_index(events: &[Event], scan: usize) -> usize {
    let scans = events
        .iter()
        .enumerate()
        .filter(|(_, event)| matches!(event, Event::Scan(_)));
    scans.map(|(index, _)| index).nth(scan).unwrap()
}

pub fn scan(events: &mut [Event], number: usize) -> &mut Message<RadarScan> {
    let index = scan_index(events, number);
    match &mut events[index] {
        Event::Scan(scan) => scan,
        other => panic!("{other:?}"),
    }
}

pub fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}
