//! Well-formed messages with wrong content, drawn at random, before a sensor speaks, while it
//! begins to, and later: its own data come within two seconds all the same.
//!
//! The drivers run in this process; each trial has an emulator of its own. The wrong messages come
//! by the sensor's own socket or port, which is the hardest: nothing pins them out.

use crate::support::pipeline::log;
use crate::support::sensors::{Sensors, unix_s};
use crate::support::turns::RealTime;
use randt_config::{Config, Selection};
use randt_imu::Imu;
use randt_messages::{ImuSampleTopic, MessageRef, RadarScan, SensorKind};
use randt_radar::Radar;
use rustix::time::{ClockId, clock_gettime};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

const PROTOCOLS: [&str; 4] = ["beam-udp", "navtech", "mip", "xsens"];
/// Wrong messages before the sensor speaks and while it begins to, then once more; s after the
/// emulator's beginning.
const FAULTS: [&str; 3] = ["silence@0+1.2", "wrong@0+2.0", "wrong@4.2+0.6"];
/// From these moments on its own data are due, s, each until the one after it.
const DUE_S: [(f64, f64); 2] = [(1.2, 4.2), (4.8, 7.0)];
/// A sweep is the radar's with that many of its 220 beams.
const BEAMS_MIN: usize = 215;
/// They are there within this time, s.
const BACK_MAX_S: f64 = 2.0;
/// Own data of an IMU have come with that many samples within a time, s: a wrong message whose
/// rates are right by chance is one.
const SAMPLES_MIN: usize = 20;
const SAMPLES_WITHIN_S: f64 = 0.2;
/// Trials side by side: they sleep most of the time.
const THREADS: usize = 10;

/// What a drive's messages are known by: a beam by its bins, a sample by its rates.
fn known(log: &Path) -> (BTreeSet<Vec<u16>>, BTreeSet<Vec<u8>>) {
    let (mut beams, mut samples) = (BTreeSet::new(), BTreeSet::new());
    let mut reader = randt_log::LogReader::open(log).unwrap();
    while let Some(entry) = reader.next_entry().unwrap() {
        if let Some(scan) = entry.decode::<RadarScan>().unwrap() {
            beams.extend(of_beams(scan.as_ref()));
        }
        if let Some(sample) = entry.decode::<ImuSampleTopic>().unwrap() {
            samples.insert(of_sample(sample.head.rate_rad_s));
        }
    }
    (beams, samples)
}

/// The bins of each beam.
fn of_beams(scan: MessageRef<'_, RadarScan>) -> impl Iterator<Item = Vec<u16>> {
    let total = scan.items.len();
    let beams = 0..scan.head.sweep.beams().len();
    beams.map(move |beam| {
        let returns = &scan.items[scan.head.sweep.returns_of(beam, total)];
        returns.iter().map(|item| item.bin).collect()
    })
}

/// The rates as the wire has them.
fn of_sample(rate_rad_s: [f64; 3]) -> Vec<u8> {
    let rates = rate_rad_s.iter();
    rates
        .flat_map(|rate| (*rate as f32).to_le_bytes())
        .collect()
}

fn boot_ns() -> i64 {
    let time = clock_gettime(ClockId::Boottime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

/// When the sensor's own data came, s after the emulator's beginning, and the driver's status at
/// the end.
fn trial(protocol: &'static str, seed: u64, log: &Path) -> (Vec<f64>, String) {
    let (beams, samples) = known(log);
    let folder = tempfile::tempdir().unwrap();
    let is_radar = ["beam-udp", "navtech"].contains(&protocol);
    let sensors = if is_radar {
        Sensors::new(folder.path(), protocol, "mip")
    } else {
        Sensors::new(folder.path(), "beam-udp", protocol)
    };
    let selection = Selection {
        robot: Some(sensors.robot().display().to_string()),
        sensor: Some("isdr-c".to_owned()),
        ..Selection::default()
    };
    let config = Config::load(&selection).unwrap().config;
    let begin_s = unix_s() + 0.7;
    let (second, seed) = (format!("{begin_s:.6}"), seed.to_string());
    let mut more = vec!["--at", &second, "--seed", &seed, "--loop"];
    more.extend(FAULTS.iter().flat_map(|fault| ["--fault", fault]));
    let _emulator = if is_radar {
        sensors.radar(log, &more)
    } else {
        sensors.imu(log, &more)
    };
    let mut came = Vec::new();
    let mut radar = is_radar.then(|| Radar::new(&config).unwrap());
    let mut imu = (!is_radar).then(|| Imu::new(&config).unwrap());
    let end_s = DUE_S[1].1;
    loop {
        let at_s = unix_s() - begin_s;
        if at_s > end_s {
            break;
        }
        if let Some(radar) = &mut radar {
            radar.poll(boot_ns(), &mut |sweep| {
                let scan = sweep.message(SensorKind::IsdrC);
                let own = of_beams(scan.as_ref()).filter(|bins| beams.contains(bins));
                if own.count() >= BEAMS_MIN {
                    came.push(at_s);
                }
            });
        }
        if let Some(imu) = &mut imu {
            imu.poll(boot_ns(), &mut |sample| {
                if samples.contains(&of_sample(sample.rate_rad_s)) {
                    came.push(at_s);
                }
            });
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let output = match (&radar, &imu) {
        (Some(radar), _) => format!("{:?} {:?}", radar.link(), radar.counters()),
        (_, Some(imu)) => format!("{:?} {:?}", imu.link(), imu.counters()),
        _ => String::new(),
    };
    (came, output)
}

/// How long after each due moment its own data came, s: the first of that many within a time.
fn waited_s(came: &[f64], data_min: usize) -> [f64; 2] {
    DUE_S.map(|(from_s, to_s)| {
        let due = |at_s: &&f64| (from_s..to_s).contains(*at_s);
        let within: Vec<f64> = came.iter().filter(due).copied().collect();
        let mut runs = within.windows(data_min);
        let run = runs.find(|run| run[data_min - 1] - run[0] <= SAMPLES_WITHIN_S);
        run.map_or(f64::INFINITY, |run| run[0] - from_s)
    })
}

fn seeds(count: u64) {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let _real_time = RealTime::begin();
    let alone = std::env::var("RANDT_PROTOCOL").unwrap_or_default();
    let trials: Vec<(&str, u64)> = PROTOCOLS
        .iter()
        .filter(|protocol| alone.is_empty() || alone == **protocol)
        .flat_map(|protocol| (1..=count).map(move |seed| (*protocol, seed)))
        .collect();
    let next = AtomicU64::new(0);
    let wrong = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some((protocol, seed)) =
                    trials.get(next.fetch_add(1, Ordering::Relaxed) as usize)
                {
                    let (came, output) = trial(protocol, *seed, &log);
                    let is_imu = ["mip", "xsens"].contains(protocol);
                    let waited_s = waited_s(&came, if is_imu { SAMPLES_MIN } else { 1 });
                    println!("{protocol:9} seed {seed:3}: own data after {waited_s:.2?} s");
                    if waited_s.iter().any(|waited_s| *waited_s > BACK_MAX_S) {
                        let row = format!("{protocol} seed {seed}: {waited_s:?}: {output}");
                        wrong.lock().unwrap().push(row);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_sensor_is_heard_in_spite_of_wrong_messages() {
    seeds(5);
}

#[test]
#[ignore = "ten minutes, or RANDT_PROTOCOL=xsens alone: cargo test --test programs wrong_packets:: -- --ignored --nocapture"]
fn a_sensor_is_heard_in_spite_of_200_wrong_messages_of_each_protocol() {
    seeds(200);
}
