//! The whole chain live on one machine: both sensors emulated, both drivers, filter, odometry,
//! mapper.

use crate::support::pipeline::{Pipeline, signal};
use crate::support::sensors::{Emulator, Sensors, unix_s};
use crate::support::turns::RealTime;
use crate::support::{ended, figures, randt, report, run, tum};
use randt_stage::{Domain, Registry};
use rustix::process::Signal;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Stages and drivers are up long before.
const START: f64 = 4.0;
/// The emulators begin this long before the log's first stamp.
const LEAD_NS: i64 = 500_000_000;
const PERIOD_S: f64 = 0.2;

/// A drive through the building: its log, its truth, and the ATE of its replay.
struct Drive {
    log: PathBuf,
    truth: PathBuf,
    replayed_m: f64,
}

impl Drive {
    fn new(folder: &Path, scans: u32) -> Self {
        let at = |name: &str| folder.join(name);
        let mut command = randt(&["simulate", "building", "--scans", &scans.to_string()]);
        command.arg("--out").arg(at("drive.mcap"));
        command.arg("--truth").arg(at("truth.tum"));
        let made = ended(command);
        assert_eq!(made.code, Some(0), "{}", made.stderr);
        let offline = run(&at("drive.mcap"), &at("run"), &[]);
        assert_eq!(offline.code, Some(0), "{}", offline.stderr);
        Self {
            replayed_m: ate_m(&at("run"), &at("truth.tum")),
            log: at("drive.mcap"),
            truth: at("truth.tum"),
        }
    }

    /// The truth as it was lived: the log's first stamp came at a time of the system's clock.
    fn lived(&self, path: &Path, begin_s: f64) {
        let rows = tum(&self.truth);
        let first_ns = first_stamp_ns(&self.log);
        let shift_ns = (begin_s * 1e9) as i64 + LEAD_NS - first_ns;
        let mut text = String::new();
        for (row, line) in rows
            .iter()
            .zip(fs::read_to_string(&self.truth).unwrap().lines())
        {
            let (_, pose) = line.split_once(' ').unwrap();
            let stamp_ns = row.stamp_ns + shift_ns;
            let (s, ns) = (stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000);
            writeln!(text, "{s}.{ns:09} {pose}").unwrap();
        }
        fs::write(path, text).unwrap();
    }
}

fn first_stamp_ns(log: &Path) -> i64 {
    let mut reader = randt_log::LogReader::open(log).unwrap();
    reader.next_entry().unwrap().unwrap().stamp_ns()
}

fn ate_m(out: &Path, truth: &Path) -> f64 {
    figures(out, "trajectory.tum", truth)["ate_rmse_m"]
        .as_f64()
        .unwrap()
}

/// Resident memory of every stage, bytes.
fn memory(domain: &Domain) -> BTreeMap<String, u64> {
    let resident = |pid: u64| {
        let text = fs::read_to_string(format!("/proc/{pid}/statm")).ok()?;
        Some(text.split(' ').nth(1)?.parse::<u64>().ok()? * 4096)
    };
    let stages = Registry::all(domain)
        .into_iter()
        .filter(|(_, lives)| *lives);
    stages
        .filter_map(|(entry, _)| Some((entry.name, resident(entry.pid)?)))
        .collect()
}

/// `randt up` with drivers; killed where a test fails before it ends.
struct Up(Child);

impl Up {
    fn start(mut command: Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::null());
        Self(command.spawn().unwrap())
    }

    /// Ends it as Ctrl-C does; its exit code.
    fn stop(mut self) -> Option<i32> {
        signal(self.0.id(), Signal::INT);
        self.0.wait().unwrap().code()
    }
}

impl Drop for Up {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Lives a drive and holds it against its replay.
fn live(radar: &'static str, imu: &'static str, scans: u32, more: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let drive = Drive::new(folder.path(), scans);
    let sensors = Sensors::new(folder.path(), radar, imu);
    let own = Pipeline::new("live");
    let real_time = RealTime::begin();
    let mut command = own.command(&["up"]);
    command
        .arg("--robot")
        .arg(sensors.robot())
        .arg("--out")
        .arg(at("up"))
        .args(more);
    let up = Up::start(command);

    let begin_s = unix_s() + START;
    let second = format!("{begin_s:.3}");
    let more = ["--at", &second];
    let mut emulators = [
        sensors.radar(&drive.log, &more),
        sensors.imu(&drive.log, &more),
    ];
    let drive_s = f64::from(scans) * PERIOD_S;
    let begin = Instant::now();
    let mut early = BTreeMap::new();
    while !emulators.iter_mut().all(Emulator::ended) {
        let elapsed_s = begin.elapsed().as_secs_f64();
        assert!(elapsed_s < drive_s + 120.0, "the emulators do not end");
        if early.is_empty() && elapsed_s > START + drive_s / 8.0 {
            early = memory(own.domain());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let late = memory(own.domain());
    // 3 would mean that a beam, a sample or a message was lost.
    assert_eq!(up.stop(), Some(0), "{}", report(&at("up"))["counters"]);
    drop(real_time);
    let live = report(&at("up"));
    drive.lived(&at("lived.tum"), begin_s);
    let lived_m = ate_m(&at("up"), &at("lived.tum"));
    let replayed_m = drive.replayed_m;
    println!(
        "{radar} and {imu}: {} of {scans} scans, ATE {lived_m:.4} m live, {replayed_m:.4} m replayed; {}",
        live["scans"], live["counters"]
    );
    // The first sweep is not whole, and the last one's end is a beam of the next.
    assert!(
        live["scans"].as_u64().unwrap() + 3 >= u64::from(scans),
        "{live}"
    );
    assert!(lived_m <= (1.1 * replayed_m).max(replayed_m + 0.01));
    for (name, late) in late {
        let early = early[&name];
        println!(
            "{name}: {:.1} MB, {:.1} MB at the end",
            early as f64 * 1e-6,
            late as f64 * 1e-6
        );
        // The mapper's grows with the map, the supervisor's with the trajectory; and in an eighth
        // of a short drive the histories on the bus are not full yet.
        if scans >= 600 && !["mapper", "up"].contains(&name.as_str()) {
            assert!(late as f64 <= 1.1 * early as f64, "{name} grows");
        }
    }
}

#[test]
fn two_minutes_live_are_as_exact_as_their_replay() {
    live("beam-udp", "mip", 600, &[]);
}

#[test]
fn a_navtech_and_an_xsens_lead_through_the_same_building() {
    // Its bins and beams are those of the simulated radar.
    live("navtech", "xsens", 150, &["--sensor", "isdr-c"]);
}

#[test]
#[ignore = "takes ten minutes"]
fn ten_minutes_live_are_as_exact_as_their_replay() {
    live("beam-udp", "mip", 3000, &[]);
}
