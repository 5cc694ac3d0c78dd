//! Disks that are full, broken, gone or slow: what is recorded, what is reported.

use crate::support::{
    BEGIN_NS, Drive, Faulty, Name, S, Wrong, drops, name, read, recorder, settings,
};
use randt_log::LogReader;
use randt_messages::{DropCause, LogDrop, health::text_of};
use randt_recorder::{BUDGET, Queue, Recorder, Sink, Worker};
use std::collections::BTreeSet;
use std::io::{Cursor, ErrorKind};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A recorder behind its queue, without threads.
struct Bench {
    sink: Faulty,
    recorder: Recorder<Faulty>,
    queue: Queue,
    drive: Drive,
    now_ns: i64,
    all: BTreeSet<Name>,
}

impl Bench {
    fn new(budget: usize) -> Self {
        let sink = Faulty::default();
        Self {
            recorder: recorder(sink.clone(), settings()),
            sink,
            queue: Queue::new(budget),
            drive: Drive::new(300),
            now_ns: BEGIN_NS,
            all: BTreeSet::new(),
        }
    }

    /// What the stage and its thread do, for this time.
    fn run(&mut self, seconds: f64) {
        let end_ns = self.now_ns + (seconds * 1e9) as i64;
        while self.now_ns < end_ns {
            self.now_ns += S / 10;
            let raws = self.drive.until(self.now_ns);
            self.all.extend(raws.iter().map(name));
            self.queue.push(raws, self.now_ns);
            self.recorder.tick(self.now_ns);
            if self.recorder.is_recording() {
                let drops = self.queue.take_drops();
                self.recorder.push_drops(&drops, self.now_ns);
                for raw in self.queue.take(usize::MAX) {
                    self.recorder.push(raw, self.now_ns);
                }
            }
            let outage = self.recorder.outage();
            self.queue
                .set_drop_cause(outage.map_or(DropCause::Slow, |t| t.cause));
        }
    }

    fn recorded(&self) -> BTreeSet<Name> {
        let files = self.sink.files().into_values();
        files.flat_map(|file| read(&file.bytes)).collect()
    }
}

#[test]
fn after_a_failed_write_the_next_file_has_everything() {
    for kind in [ErrorKind::StorageFull, ErrorKind::Other] {
        let mut bench = Bench::new(BUDGET);
        bench.run(3.0);
        let wrong = Wrong {
            writes: Some(kind),
            ..Wrong::default()
        };
        bench.sink.set(wrong);
        bench.run(2.0);
        let outage = bench.recorder.outage().unwrap();
        let full = kind == ErrorKind::StorageFull;
        assert_eq!(outage.cause == DropCause::Full, full, "{outage:?}");
        bench.sink.set(Wrong::default());
        bench.run(3.0);
        assert_eq!(bench.recorder.outage(), None);
        bench.recorder.finish(bench.now_ns);
        assert_eq!(bench.recorded(), bench.all);
        assert_eq!(bench.queue.lost(), 0);
        // The one that failed, and the one that has it all again.
        let files = bench.sink.files();
        let finished = files.values().filter(|file| file.finished).count();
        assert_eq!((files.len(), finished), (2, 1));
        for (name, file) in files.iter().filter(|(_, file)| file.finished) {
            let mut reader = LogReader::new(Cursor::new(&file.bytes), name.as_str()).unwrap();
            assert!(reader.metadata("randt/config").is_some(), "{name}");
            while reader.next_entry().unwrap().is_some() {}
            assert!(reader.damage().is_empty(), "{name}: {:?}", reader.damage());
        }
    }
}

#[test]
fn a_folder_that_takes_no_files_is_reported_and_tried_again() {
    let mut bench = Bench::new(BUDGET);
    bench.sink.set(Wrong {
        creates: Some(ErrorKind::ReadOnlyFilesystem),
        ..Wrong::default()
    });
    bench.run(3.0);
    let text = &bench.recorder.outage().unwrap().text;
    assert!(text.contains("read-only"), "{text}");
    bench.sink.set(Wrong::default());
    bench.run(2.0);
    bench.recorder.finish(bench.now_ns);
    assert_eq!(bench.recorded(), bench.all);
}

#[test]
fn a_folder_that_is_removed_costs_what_was_in_it() {
    let mut bench = Bench::new(BUDGET);
    bench.run(3.0);
    let before = bench.all.clone();
    bench.sink.remove_folder();
    bench.run(3.0);
    bench.recorder.finish(bench.now_ns);
    let recorded = bench.recorded();
    let after: BTreeSet<_> = bench.all.difference(&before).cloned().collect();
    assert!(recorded.is_superset(&after), "all that came later is there");
    // The next file lists what was lost with the folder.
    let files = bench.sink.files();
    let reported: u64 = files
        .values()
        .flat_map(|file| drops(&file.bytes))
        .map(|drop| drop.count)
        .sum();
    let missing = (bench.all.len() - recorded.len()) as u64;
    assert!(missing > 500, "{missing}");
    assert_eq!((reported, bench.recorder.lost()), (missing, missing));
}

#[test]
fn below_the_floor_it_stops_and_goes_on_when_there_is_room() {
    let mut bench = Bench::new(100_000);
    bench.run(2.0);
    bench.sink.set(Wrong {
        free_bytes: Some(1_999_999_999),
        ..Wrong::default()
    });
    bench.run(10.0);
    let outage = bench.recorder.outage().unwrap();
    assert_eq!(outage.cause, DropCause::Full);
    assert!(outage.text.contains("2.0 GB"), "{outage:?}");
    bench.sink.set(Wrong::default());
    bench.run(2.0);
    bench.recorder.finish(bench.now_ns);
    let files = bench.sink.files();
    assert_eq!(files.len(), 2);
    assert!(files.values().all(|file| file.finished));
    // What did not fit into memory meanwhile is missing, and the log lists how much.
    let reported: Vec<_> = files.values().flat_map(|file| drops(&file.bytes)).collect();
    let missing = bench.all.len() - bench.recorded().len();
    assert!(missing > 500, "{missing}");
    assert_eq!(
        reported.iter().map(|drop| drop.count).sum::<u64>(),
        missing as u64
    );
    assert_eq!(bench.queue.lost(), missing as u64);
    for drop in reported {
        assert_eq!(DropCause::from_code(drop.cause), DropCause::Full);
        assert!(text_of(&drop.topic) == "imu/sample/v1" || text_of(&drop.topic) == "radar/scan/v1");
        assert!(drop.end_ns - drop.begin_ns > 5 * S, "{drop:?}");
    }
}

#[test]
fn the_oldest_logs_go_where_that_is_configured() {
    let sink = Faulty::default();
    let mut settings = settings();
    settings.delete_oldest = true;
    settings.file_max_ns = S;
    let mut recorder = recorder(sink.clone(), settings);
    let mut drive = Drive::new(300);
    for step in 1..100 {
        let now_ns = BEGIN_NS + step * S / 10;
        drive
            .until(now_ns)
            .into_iter()
            .for_each(|raw| recorder.push(raw, now_ns));
        recorder.tick(now_ns);
        if step == 50 {
            assert!(sink.files().len() > 4, "files are a second long");
            sink.set(Wrong {
                free_bytes: Some(2_000_000_000 - 1),
                ..Wrong::default()
            });
        }
    }
    assert_eq!(recorder.outage(), None);
    let names: Vec<_> = sink.files().into_keys().collect();
    assert!(
        !names.contains(&"2026-11-24T13-05-10Z.mcap".to_owned()),
        "{names:?}"
    );
}

/// The result of a drive.
struct Outcome {
    lost: u64,
    drops: Vec<LogDrop>,
    recorded: BTreeSet<Name>,
    all: BTreeSet<Name>,
}

/// The disk in a thread of its own, as in the process, stalls once.
fn stalled_for(stall: Duration, budget: usize, returns: usize) -> Outcome {
    let sink = Faulty::default();
    let queue = Arc::new(Queue::new(budget));
    let begin = Instant::now();
    let clock = move || BEGIN_NS + begin.elapsed().as_nanos() as i64;
    let worker = Worker::start(
        Arc::clone(&queue),
        recorder(sink.clone(), settings()),
        clock,
        |_| {},
    );
    let mut drive = Drive::new(returns);
    let mut all = BTreeSet::new();
    let mut longest = Duration::ZERO;
    let mut reported = false;
    let end = stall + Duration::from_secs(3);
    let mut has_stalled = false;
    while begin.elapsed() < end {
        if !has_stalled && begin.elapsed() > Duration::from_secs(1) {
            has_stalled = true;
            sink.set(Wrong {
                stall: Some(stall),
                ..Wrong::default()
            });
        }
        let raws = drive.until(clock());
        all.extend(raws.iter().map(name));
        let before = Instant::now();
        queue.push(raws, clock());
        longest = longest.max(before.elapsed());
        reported |= worker.status().outage.contains("not answered");
        std::thread::sleep(Duration::from_millis(20));
    }
    worker.finish();
    println!("the bus waited {longest:?} at most");
    // Milliseconds; more on a busy machine, but not for as long as the disk.
    assert!(
        longest < stall / 2,
        "the bus waited {longest:?} for the disk"
    );
    assert!(reported, "a stall is reported while it lasts");
    let files = sink.files();
    let drops = files.values().flat_map(|file| drops(&file.bytes)).collect();
    let recorded = files.values().flat_map(|file| read(&file.bytes)).collect();
    Outcome {
        lost: queue.lost(),
        drops,
        recorded,
        all,
    }
}

#[test]
fn a_disk_that_stalls_for_two_seconds_costs_nothing() {
    // 10,000 returns a scan, as an iSDR-C has.
    let outcome = stalled_for(Duration::from_secs(2), BUDGET, 10_000);
    assert_eq!((outcome.lost, outcome.drops.len()), (0, 0));
    assert_eq!(outcome.recorded, outcome.all);
}

#[test]
fn what_a_longer_stall_costs_is_counted_and_written() {
    let outcome = stalled_for(Duration::from_secs(2), 100_000, 300);
    let (lost, drops) = (outcome.lost, outcome.drops);
    assert!(lost > 0);
    assert_eq!(outcome.all.len() - outcome.recorded.len(), lost as usize);
    assert_eq!(drops.iter().map(|drop| drop.count).sum::<u64>(), lost);
    assert!(
        drops
            .iter()
            .all(|drop| drop.cause == DropCause::Slow as u32)
    );
}

#[test]
fn a_sink_that_is_off_is_no_sink() {
    // The fake itself: after the power cut nothing changes any more.
    let mut sink = Faulty::default();
    sink.set(Wrong {
        power_cut_after: Some(2),
        ..Wrong::default()
    });
    sink.create("a").unwrap();
    sink.append(b"1").unwrap();
    sink.append(b"2").unwrap();
    sink.sync().unwrap();
    let file = &sink.files()["a"];
    assert_eq!((file.bytes.as_slice(), file.synced), (b"1".as_slice(), 0));
}
