//! Every fault that sensors have, injected by the emulators: it is counted, what it spoils is
//! flagged, it costs next to nothing, and afterwards all is as before.
//!
//! The drivers run in this process, without shared memory: their own time on the processor can be
//! measured. Each trial has an emulator of its own, as a process; all run side by side.

use crate::support::pipeline::log;
use crate::support::sensors::{Sensors, unix_s};
use crate::support::turns::RealTime;
use randt_config::{Config, Selection};
use randt_device::Count;
use randt_imu::Imu;
use randt_radar::Radar;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// When the fault begins and ends, and when all is over, s after the emulator's beginning.
const BEGIN_S: f64 = 3.0;
const DURATION_S: f64 = 1.5;
const END_S: f64 = 8.0;
/// Everything is as before this long after the fault's end.
const BACK_MAX_S: f64 = 2.0;
/// Of one core, while it lasts.
const PROCESSOR_MAX: f64 = 0.05;
/// Trials side by side: they sleep most of the time.
const THREADS: usize = 8;

/// What a fault does to what comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Harm {
    /// Nothing: all sweeps whole, all samples there.
    None,
    /// Sweeps are flagged as partial, or samples missing and counted.
    Some,
    /// What was under way when the connection broke, by the counter of connections.
    Any,
    /// Nothing comes out.
    All,
}

/// A fault of a protocol: the counter that shows it, where there is one, and the harm.
struct Trial {
    protocol: &'static str,
    fault: &'static str,
    counter: &'static str,
    harm: Harm,
}

const fn trial(
    protocol: &'static str,
    fault: &'static str,
    counter: &'static str,
    harm: Harm,
) -> Trial {
    Trial {
        protocol,
        fault,
        counter,
        harm,
    }
}

const TRIALS: &[Trial] = &[
    trial("beam-udp", "silence", "interruptions", Harm::All),
    trial("beam-udp", "unplug", "interruptions", Harm::All),
    trial(
        "beam-udp",
        "junk",
        "datagrams_of_another_protocol",
        Harm::None,
    ),
    trial("beam-udp", "checksum", "datagrams_damaged", Harm::Some),
    trial("beam-udp", "cut", "datagrams_damaged", Harm::Some),
    trial(
        "beam-udp",
        "version",
        "datagrams_of_unknown_version",
        Harm::All,
    ),
    trial("beam-udp", "lost", "beams_lost", Harm::Some),
    trial("beam-udp", "doubled", "beams_doubled", Harm::None),
    trial("beam-udp", "reordered", "beams_reordered", Harm::None),
    trial("beam-udp", "contour", "", Harm::None),
    trial("beam-udp", "jitter", "", Harm::None),
    trial("beam-udp", "skew", "", Harm::None),
    trial("beam-udp", "clock-reset", "clock_restarts", Harm::None),
    trial("navtech", "silence", "interruptions", Harm::All),
    trial("navtech", "close", "connections", Harm::Any),
    trial("navtech", "unplug", "connections", Harm::All),
    trial("navtech", "split", "", Harm::None),
    trial("navtech", "junk", "junk_bytes", Harm::None),
    trial("navtech", "cut", "junk_bytes", Harm::Some),
    trial(
        "navtech",
        "version",
        "messages_of_unknown_version",
        Harm::All,
    ),
    trial("navtech", "oversize", "messages_oversize", Harm::Some),
    trial("navtech", "lost", "beams_lost", Harm::Some),
    trial("navtech", "doubled", "beams_doubled", Harm::None),
    trial("navtech", "reordered", "beams_reordered", Harm::None),
    trial("navtech", "contour", "", Harm::None),
    trial("navtech", "jitter", "", Harm::None),
    trial("navtech", "skew", "", Harm::None),
    trial("navtech", "clock-reset", "clock_restarts", Harm::None),
    trial("mip", "silence", "interruptions", Harm::All),
    trial("mip", "close", "reconnects", Harm::Any),
    trial("mip", "unplug", "reconnects", Harm::All),
    trial("mip", "split", "", Harm::None),
    trial("mip", "junk", "junk_bytes", Harm::None),
    trial("mip", "checksum", "checksum_errors", Harm::Some),
    trial("mip", "cut", "checksum_errors", Harm::Some),
    trial("mip", "lost", "samples_lost", Harm::Some),
    trial("mip", "skew", "", Harm::None),
    trial("mip", "clock-reset", "clock_resets", Harm::None),
    trial("mip", "rate", "samples_lost", Harm::Some),
    trial("xsens", "silence", "interruptions", Harm::All),
    trial("xsens", "close", "reconnects", Harm::Any),
    trial("xsens", "unplug", "reconnects", Harm::All),
    trial("xsens", "split", "", Harm::None),
    trial("xsens", "junk", "junk_bytes", Harm::None),
    trial("xsens", "checksum", "checksum_errors", Harm::Some),
    trial("xsens", "cut", "checksum_errors", Harm::Some),
    trial("xsens", "lost", "samples_lost", Harm::Some),
    trial("xsens", "skew", "", Harm::None),
    trial("xsens", "clock-reset", "clock_resets", Harm::None),
    trial("xsens", "rate", "samples_lost", Harm::Some),
];

impl Trial {
    fn is_radar(&self) -> bool {
        ["beam-udp", "navtech"].contains(&self.protocol)
    }
}

/// Either driver.
enum Driver {
    Radar(Box<Radar>),
    Imu(Box<Imu>),
}

impl Driver {
    fn new(is_radar: bool, config: &Config) -> Self {
        if is_radar {
            Self::Radar(Box::new(Radar::new(config).unwrap()))
        } else {
            Self::Imu(Box::new(Imu::new(config).unwrap()))
        }
    }

    /// Takes what has come: whether each sweep was whole; samples always are.
    fn poll(&mut self, now_ns: i64, came: &mut Vec<bool>) {
        match self {
            Self::Radar(radar) => {
                radar.poll(now_ns, &mut |sweep| came.push(sweep.beams_lost() == 0))
            }
            Self::Imu(imu) => imu.poll(now_ns, &mut |_| came.push(true)),
        }
    }

    /// Sleeps as the process does.
    fn sleep(&self, now_ns: i64, at_most_s: f64) {
        let (descriptor, due_ns) = match self {
            Self::Radar(radar) => (Some(radar.descriptor()), radar.due_ns()),
            Self::Imu(imu) => (imu.descriptor(), imu.due_ns()),
        };
        let pause_ns = due_ns
            .saturating_sub(now_ns)
            .clamp(0, (at_most_s * 1e9) as i64);
        let pause = Timespec {
            tv_sec: pause_ns / 1_000_000_000,
            tv_nsec: pause_ns % 1_000_000_000,
        };
        let mut on: Vec<PollFd<'_>> = descriptor
            .iter()
            .map(|descriptor| PollFd::new(descriptor, PollFlags::IN))
            .collect();
        poll(&mut on, Some(&pause)).unwrap();
    }

    fn counters(&self) -> BTreeMap<&'static str, Count> {
        let counters = match self {
            Self::Radar(radar) => radar.counters(),
            Self::Imu(imu) => imu.counters(),
        };
        counters
            .into_iter()
            .map(|count| (count.name, count))
            .collect()
    }

    fn link_text(&self) -> String {
        match self {
            Self::Radar(radar) => radar.link().text().to_owned(),
            Self::Imu(imu) => imu.link().text().to_owned(),
        }
    }
}

/// What a trial showed.
struct Shown {
    /// Sweeps or samples: when, and whether whole; s after the emulator's beginning.
    came: Vec<(f64, bool)>,
    before: BTreeMap<&'static str, Count>,
    after: BTreeMap<&'static str, Count>,
    /// Share of a core while the fault lasted.
    processor: f64,
    link_text: String,
}

fn thread_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn boot_ns() -> i64 {
    let time = clock_gettime(ClockId::Boottime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

fn show(trial: &Trial, log: &Path) -> Shown {
    let folder = tempfile::tempdir().unwrap();
    let sensors = if trial.is_radar() {
        Sensors::new(folder.path(), trial.protocol, "mip")
    } else {
        Sensors::new(folder.path(), "beam-udp", trial.protocol)
    };
    let selection = Selection {
        robot: Some(sensors.robot().display().to_string()),
        sensor: Some("isdr-c".to_owned()),
        ..Selection::default()
    };
    let config = Config::load(&selection).unwrap().config;
    let begin_s = unix_s() + 0.5;
    let second = format!("{begin_s:.6}");
    let fault = format!("{}@{BEGIN_S}+{DURATION_S}", trial.fault);
    let more = ["--at", &second, "--fault", &fault, "--loop"];
    let _emulator = if trial.is_radar() {
        sensors.radar(log, &more)
    } else {
        sensors.imu(log, &more)
    };
    let mut driver = Driver::new(trial.is_radar(), &config);
    let (mut came, mut new) = (Vec::new(), Vec::new());
    let (mut before, mut processor, mut link_text) = (None, None, String::new());
    loop {
        let at_s = unix_s() - begin_s;
        if at_s > END_S {
            break;
        }
        if at_s > BEGIN_S - 0.1 && before.is_none() {
            before = Some((driver.counters(), thread_s(), at_s));
        }
        if at_s > BEGIN_S + DURATION_S && processor.is_none() {
            let (_, spent_s, from_s) = before.as_ref().unwrap();
            processor = Some((thread_s() - spent_s) / (at_s - from_s));
            link_text = driver.link_text();
        }
        driver.poll(boot_ns(), &mut new);
        came.extend(new.drain(..).map(|whole| (at_s, whole)));
        driver.sleep(boot_ns(), 0.05);
    }
    Shown {
        came,
        before: before.unwrap().0,
        after: driver.counters(),
        processor: processor.unwrap(),
        link_text,
    }
}

/// When what comes is whole again and in its pace for a second, s after the fault's end.
fn back_s(trial: &Trial, came: &[(f64, bool)]) -> f64 {
    let rate_hz = if trial.is_radar() { 5.0 } else { 250.0 };
    let end_s = BEGIN_S + DURATION_S;
    let after = came.iter().filter(|(at_s, _)| *at_s >= end_s);
    let is_good = |from_s: f64| {
        let second = |(at_s, _): &&(f64, bool)| (from_s..from_s + 1.0).contains(at_s);
        let (count, whole) = came
            .iter()
            .filter(second)
            .fold((0, true), |(count, all), (_, whole)| {
                (count + 1, all && *whole)
            });
        whole && f64::from(count) >= 0.8 * rate_hz
    };
    let mut starts = after.map(|(at_s, _)| *at_s);
    starts
        .find(|at_s| is_good(*at_s))
        .map_or(f64::INFINITY, |at_s| at_s - end_s)
}

/// Its row of the table, and what is wrong.
fn judge(trial: &Trial, shown: &Shown) -> (String, Vec<String>) {
    let value =
        |counts: &BTreeMap<_, Count>, name| counts.get(name).map_or(0, |count: &Count| count.value);
    let rise = |name| value(&shown.after, name) - value(&shown.before, name);
    let back_s = back_s(trial, &shown.came);
    let during = |(at_s, _): &&(f64, bool)| (BEGIN_S + 0.4..BEGIN_S + DURATION_S).contains(at_s);
    let came = shown.came.iter().filter(during).count();
    let corrupted = shown
        .came
        .iter()
        .filter(|(at_s, whole)| *at_s > BEGIN_S && !whole)
        .count();
    let lost: u64 = shown
        .after
        .values()
        .filter(|count| count.loss)
        .map(|count| count.value - value(&shown.before, count.name))
        .sum();
    let row = format!(
        "{:9} {:12} {:30} {:>8} {came:>6} {corrupted:>6} {lost:>6} {back_s:>7.2} {:>6.2}  {}",
        trial.protocol,
        trial.fault,
        if trial.counter.is_empty() {
            "-"
        } else {
            trial.counter
        },
        if trial.counter.is_empty() {
            0
        } else {
            rise(trial.counter)
        },
        100.0 * shown.processor,
        shown.link_text,
    );
    let mut wrong = Vec::new();
    let mut check = |holds: bool, what: &str| {
        if !holds {
            wrong.push(format!("{} {}: {what}", trial.protocol, trial.fault));
        }
    };
    check(
        shown
            .came
            .iter()
            .filter(|(at_s, _)| *at_s < BEGIN_S)
            .count()
            > 5,
        "nothing came before it",
    );
    check(
        trial.counter.is_empty() || rise(trial.counter) > 0,
        "it is not counted",
    );
    check(back_s <= BACK_MAX_S, "it is not back in time");
    check(shown.processor <= PROCESSOR_MAX, "it costs too much");
    match trial.harm {
        Harm::None => check(came > 3 && corrupted == 0 && lost == 0, "it does harm"),
        Harm::Some => check(
            lost > 0 && (corrupted > 0 || !trial.is_radar()),
            "what is corrupted is not flagged",
        ),
        Harm::Any => check(came > 3, "it does not come back meanwhile"),
        Harm::All => check(came == 0, "something came"),
    }
    (row, wrong)
}

#[test]
fn every_fault_is_counted_and_passes() {
    let folder = tempfile::tempdir().unwrap();
    let log: PathBuf = log(folder.path(), 60);
    let _real_time = RealTime::begin();
    let next = AtomicUsize::new(0);
    let rows = Mutex::new(BTreeMap::new());
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some((i, trial)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    TRIALS.get(i).map(|trial| (i, trial))
                } {
                    let judged = judge(trial, &show(trial, &log));
                    rows.lock().unwrap().insert(i, judged);
                }
            });
        }
    });
    let mut table = format!(
        "{:9} {:12} {:30} {:>8} {:>6} {:>6} {:>6} {:>7} {:>6}  says\n",
        "protocol", "fault", "counter", "rises by", "came", "corrupted", "lost", "back s", "core %"
    );
    let rows = rows.into_inner().unwrap();
    for (row, _) in rows.values() {
        writeln!(table, "{row}").unwrap();
    }
    println!("{table}");
    let wrong: Vec<&String> = rows.values().flat_map(|(_, wrong)| wrong).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
