//! A live run that was recorded is computed again to the last bit, also where it had waited for
//! the IMU in vain.

use crate::support::pipeline::{Pipeline, log, signal, until};
use crate::support::sensors::{Emulator, Sensors, unix_s};
use crate::support::turns::RealTime;
use crate::support::{report, run};
use randt::compare::published;
use randt_log::{CONFIG_METADATA, LogFile, LogReader, Options, ROBOT_METADATA};
use randt_messages::{ImuSampleTopic, ImuUse, RadarScan};
use randt_stage::Registry;
use rustix::process::Signal;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const SCANS: u32 = 150;
/// Longer than a scan waits for its samples, 0.1 s, and shorter than a serial port's buffer lasts.
const STOPPED: Duration = Duration::from_millis(200);

/// Killed where a test fails before it ends.
struct Up(Child);

impl Drop for Up {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The radar's scans and the IMU's samples of a log, and nothing else.
fn strip(from: &Path, to: &Path) {
    let mut reader = LogReader::open(from).unwrap();
    let mut first = true;
    let mut log = LogFile::create(to, Options::default()).unwrap();
    loop {
        let (scan, sample) = {
            let Some(entry) = reader.next_entry().unwrap() else {
                break;
            };
            (
                entry.decode::<RadarScan>().unwrap(),
                entry.decode::<ImuSampleTopic>().unwrap(),
            )
        };
        if std::mem::take(&mut first) {
            for name in [ROBOT_METADATA, CONFIG_METADATA] {
                let record = reader.metadata(name).unwrap().clone();
                log.write_metadata(name, record).unwrap();
            }
        }
        if let Some(scan) = scan {
            log.write(scan.as_ref()).unwrap();
        }
        if let Some(sample) = sample {
            log.write(sample.as_ref()).unwrap();
        }
    }
    log.finish().unwrap();
}

fn only_log(folder: &Path) -> PathBuf {
    let files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert_eq!(files.len(), 1, "{files:?}");
    files[0].clone()
}

/// What an hour of an iSDR-C takes on the disk at most, with every topic.
const HOUR_MAX_GB: f64 = 1.5;

fn assert_hour_fits(log: &Path) {
    let mut reader = LogReader::open(log).unwrap();
    let (mut first_ns, mut last_ns) = (i64::MAX, i64::MIN);
    while let Some(entry) = reader.next_entry().unwrap() {
        (first_ns, last_ns) = (first_ns.min(entry.time_ns), last_ns.max(entry.time_ns));
    }
    let bytes = fs::metadata(log).unwrap().len() as f64;
    let hour_gb = bytes * 3600.0 / (last_ns - first_ns) as f64;
    println!("{hour_gb:.2} GB/h");
    assert!(hour_gb <= HOUR_MAX_GB);
}

#[test]
fn a_recorded_run_is_computed_again_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let drive = log(folder.path(), SCANS);
    let sensors = Sensors::new(folder.path(), "beam-udp", "mip");
    let own = Pipeline::new("replay");
    let real_time = RealTime::begin();
    let mut command = own.command(&["up"]);
    command.arg("--robot").arg(sensors.robot());
    command.arg("--out").arg(at("up"));
    command.arg("--record").arg(at("logs"));
    // Not the default, so that the log has to carry it.
    command.args(["--profile", "indoor"]);
    command.stdin(Stdio::null()).stdout(Stdio::null());
    let mut up = Up(command.spawn().unwrap());

    let second = format!("{:.3}", unix_s() + 4.0);
    let more = ["--at", &second];
    let mut emulators = [sensors.radar(&drive, &more), sensors.imu(&drive, &more)];
    let pid = || {
        let stages = Registry::all(own.domain());
        let imu = stages
            .iter()
            .find(|(entry, lives)| *lives && entry.name == "imu");
        imu.map(|(entry, _)| entry.pid as u32)
    };
    until("the driver", || pid().is_some());
    let begin = Instant::now();
    // Half of them meet the end of a sweep whose samples they hold back for too long.
    let mut stops = (0..12).map(|n| 12.0 + 1.53 * f64::from(n)).peekable();
    while !emulators.iter_mut().all(Emulator::ended) {
        if stops
            .next_if(|at_s| begin.elapsed().as_secs_f64() > *at_s)
            .is_some()
        {
            signal(pid().unwrap(), Signal::STOP);
            std::thread::sleep(STOPPED);
            signal(pid().unwrap(), Signal::CONT);
        }
        assert!(
            begin.elapsed() < Duration::from_secs(240),
            "the emulators do not end"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    signal(up.0.id(), Signal::INT);
    // 3 means that a buffer overflowed while its driver was stopped, on a busy machine: then the
    // log lacks what the run did.
    let code = up.0.wait().unwrap().code();
    drop(real_time);
    assert!([Some(0), Some(3)].contains(&code), "{code:?}");

    let recorded = only_log(&at("logs"));
    assert_hour_fits(&recorded);
    let states = published(&recorded).unwrap();
    let late = states
        .iter()
        .filter(|state| state.imu_use == ImuUse::Late as u32);
    let late = late.count();
    println!(
        "{} states, {late} without the samples they waited for",
        states.len()
    );
    assert!(late > 0 && states.len() >= 145);

    let again = run(&recorded, &at("again"), &["--compare"]);
    println!("{}", again.stdout);
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    let comparison = &report(&at("again"))["comparison"];
    assert_eq!(comparison["compared"], states.len());
    assert_eq!(comparison["differ"], 0);

    strip(&recorded, &at("stripped.mcap"));
    let stripped = run(&at("stripped.mcap"), &at("stripped"), &[]);
    assert_eq!(stripped.code, Some(0), "{}", stripped.stderr);
    let [lived, computed] =
        ["up", "stripped"].map(|name| fs::read(at(name).join("odometry.tum")).unwrap());
    assert!(lived == computed, "odometry.tum is another one");

    // By another configuration it is another trajectory, and that is reported.
    let other = run(
        &recorded,
        &at("other"),
        &["--compare", "--profile", "outdoor"],
    );
    assert_eq!(other.code, Some(1), "{}", other.stderr);
    assert!(
        other.stdout.contains("differ, first at scan"),
        "{}",
        other.stdout
    );
}
