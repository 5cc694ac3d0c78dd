//! A drive without a bus, and disks that fail as disks do.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "every test is a program of its own and uses a part of this"
)]

use randt_config::{Config, Loaded, Selection};
use randt_log::LogReader;
use randt_messages::{ImuSampleTopic, LogDrop, LogDropTopic, Message, RadarScan, Return, Topic};
use randt_recorder::Viewer;
use randt_recorder::{Positions, Raw, Recorder, Settings, Sink, configuration_records};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Cursor, ErrorKind};
use std::sync::{Arc, Mutex};
use std::time::Duration;

pub const S: i64 = 1_000_000_000;
pub const BEGIN_NS: i64 = 1_795_525_510 * S;

/// SplitMix64: the same numbers for the same seed everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

/// The messages of a drive: scans at 5 Hz, samples at 250 Hz.
pub struct Drive {
    sample: u64,
    scan: u64,
    returns: usize,
}

impl Drive {
    pub fn new(returns: usize) -> Self {
        Self {
            sample: 0,
            scan: 0,
            returns,
        }
    }

    /// All that comes up to an instant.
    pub fn until(&mut self, now_ns: i64) -> Vec<Raw> {
        let mut raws = Vec::new();
        loop {
            let sample_ns = BEGIN_NS + self.sample as i64 * S / 250;
            let scan_ns = BEGIN_NS + self.scan as i64 * S / 5;
            if sample_ns.min(scan_ns) > now_ns {
                return raws;
            }
            if scan_ns <= sample_ns {
                raws.push(scan(self.scan, scan_ns, self.returns));
                self.scan += 1;
            } else {
                raws.push(sample(self.sample, sample_ns));
                self.sample += 1;
            }
        }
    }
}

fn scan(sequence: u64, stamp_ns: i64, returns: usize) -> Raw {
    let mut scan = Message::<RadarScan>::default();
    scan.head.header.sequence = sequence;
    scan.head.header.stamp_ns = stamp_ns;
    scan.head.header.published_ns = stamp_ns;
    let mut random = Random(sequence);
    scan.items = (0..returns)
        .map(|bin| Return {
            range_m: bin as f32 * 0.0161,
            // As many digits as a real one has: they do not compress.
            intensity: 6.0 + random.below(1 << 24) as f32 * 2e-6,
            beam: 0,
            bin: bin as u16,
        })
        .collect();
    Raw::from_message(scan.as_ref())
}

fn sample(sequence: u64, stamp_ns: i64) -> Raw {
    let mut sample = Message::<ImuSampleTopic>::default();
    sample.head.header.sequence = sequence;
    sample.head.header.stamp_ns = stamp_ns;
    sample.head.header.published_ns = stamp_ns;
    let mut random = Random(sequence);
    sample.head.rate_rad_s = [0, 1, 2].map(|_| random.below(1_000_000) as f64 * 1e-6);
    Raw::from_message(sample.as_ref())
}

pub fn loaded() -> Loaded {
    Config::load(&Selection::default()).unwrap()
}

/// As configured, with chunks of 16 KiB.
pub fn settings() -> Settings {
    let mut settings = Settings::from_config(&loaded().config.record);
    settings.log.chunk_bytes = 16 << 10;
    settings
}

pub fn recorder<S: Sink>(sink: S, settings: Settings) -> Recorder<S> {
    let loaded = loaded();
    let viewer = Viewer::new(&loaded.config);
    let records = configuration_records(&loaded);
    let preamble = Box::new(move || records.clone());
    Recorder::new(sink, settings, preamble, viewer, Positions::default())
}

/// What a disk does wrong.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wrong {
    /// Everything after this many operations is lost: the power is off.
    pub power_cut_after: Option<u64>,
    /// Writes and syncs fail with this.
    pub writes: Option<ErrorKind>,
    /// Files cannot be made.
    pub creates: Option<ErrorKind>,
    /// Room that is left.
    pub free_bytes: Option<u64>,
    /// The next write takes this time.
    pub stall: Option<Duration>,
}

/// A disk in memory.
#[derive(Clone, Debug, Default)]
pub struct Faulty(Arc<Mutex<DiskState>>);

#[derive(Debug, Default)]
struct DiskState {
    files: BTreeMap<String, Stored>,
    current: Option<String>,
    wrong: Wrong,
    operations: u64,
}

/// A file: what was written, and how much of that would outlive a power cut.
#[derive(Clone, Debug, Default)]
pub struct Stored {
    pub bytes: Vec<u8>,
    pub synced: usize,
    pub finished: bool,
}

impl Faulty {
    pub fn set(&self, wrong: Wrong) {
        self.0.lock().unwrap().wrong = wrong;
    }

    pub fn operations(&self) -> u64 {
        self.0.lock().unwrap().operations
    }

    pub fn is_off(&self) -> bool {
        self.0.lock().unwrap().is_off()
    }

    pub fn files(&self) -> BTreeMap<String, Stored> {
        self.0.lock().unwrap().files.clone()
    }

    /// Removes all files, the open one too.
    pub fn remove_folder(&self) {
        self.0.lock().unwrap().files.clear();
    }
}

impl DiskState {
    fn is_off(&self) -> bool {
        let limit = self.wrong.power_cut_after;
        limit.is_some_and(|limit| self.operations > limit)
    }

    /// Counts an operation; gives the open file where the power is on.
    fn operate(&mut self) -> io::Result<Option<&mut Stored>> {
        self.operations += 1;
        if self.is_off() {
            return Ok(None);
        }
        if let Some(kind) = self.wrong.writes {
            return Err(kind.into());
        }
        let name = self.current.clone().unwrap_or_default();
        let found = self.files.get_mut(&name);
        found.map(Some).ok_or(ErrorKind::NotFound.into())
    }
}

impl Sink for Faulty {
    fn create(&mut self, name: &str) -> io::Result<()> {
        let mut state = self.0.lock().unwrap();
        state.operations += 1;
        if state.is_off() {
            return Ok(());
        }
        if let Some(kind) = state.wrong.creates {
            return Err(kind.into());
        }
        if state.files.contains_key(name) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        state.files.insert(name.to_owned(), Stored::default());
        state.current = Some(name.to_owned());
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        let stall = self.0.lock().unwrap().wrong.stall.take();
        if let Some(stall) = stall {
            std::thread::sleep(stall);
        }
        let mut state = self.0.lock().unwrap();
        if let Some(file) = state.operate()? {
            file.bytes.extend_from_slice(bytes);
        }
        Ok(())
    }

    fn sync(&mut self) -> io::Result<()> {
        let mut state = self.0.lock().unwrap();
        if let Some(file) = state.operate()? {
            file.synced = file.bytes.len();
        }
        Ok(())
    }

    fn finish(&mut self) -> io::Result<()> {
        self.sync()?;
        let mut state = self.0.lock().unwrap();
        if let Some(file) = state.operate()? {
            file.finished = true;
        }
        state.current = None;
        Ok(())
    }

    fn abandon(&mut self) {
        self.0.lock().unwrap().current = None;
    }

    fn discard(&mut self) {
        let mut state = self.0.lock().unwrap();
        if let Some(name) = state.current.take()
            && !state.is_off()
        {
            state.files.remove(&name);
        }
    }

    fn free_bytes(&mut self) -> io::Result<u64> {
        Ok(self.0.lock().unwrap().wrong.free_bytes.unwrap_or(u64::MAX))
    }

    fn delete_oldest(&mut self) -> io::Result<Option<String>> {
        let mut state = self.0.lock().unwrap();
        let mut finished = state.files.iter().filter(|(_, file)| file.finished);
        let Some(name) = finished.next().map(|(name, _)| name.clone()) else {
            return Ok(None);
        };
        let size = state.files.remove(&name).unwrap().bytes.len() as u64;
        if let Some(free) = &mut state.wrong.free_bytes {
            *free += size;
        }
        Ok(Some(name))
    }
}

/// Topic and number of a message.
pub type Name = (String, u32);

pub fn name(raw: &Raw) -> Name {
    (raw.topic.to_owned(), raw.label.sequence)
}

/// Scans and samples of a file's whole chunks, each compared with how it was made.
pub fn read(bytes: &[u8]) -> BTreeSet<Name> {
    let mut reader = LogReader::new(Cursor::new(bytes), "t").unwrap();
    reader.whole_chunks_only();
    let mut names = BTreeSet::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        let topic = entry.channel.topic.clone();
        if [RadarScan::NAME, ImuSampleTopic::NAME].contains(&topic.as_str()) {
            names.insert((topic, entry.sequence));
        }
    }
    names
}

/// The drops that a file lists.
pub fn drops(bytes: &[u8]) -> Vec<LogDrop> {
    let mut reader = LogReader::new(Cursor::new(bytes), "t").unwrap();
    let mut drops = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        if let Some(drop) = entry.decode::<LogDropTopic>().unwrap() {
            drops.push(*drop.head);
        }
    }
    drops
}
