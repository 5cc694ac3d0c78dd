//! What the system gives a stage runs out, or sensors are unplugged: it is reported, nothing is
//! silently lost, and it recovers.

use crate::support::cgroup::Group;
use crate::support::pipeline::{Pipeline, log, signal, until};
use crate::support::sensors::{Emulator, Sensors, unix_s};
use crate::support::stages::{RunFolder, program};
use crate::support::up::PATIENT;
use crate::support::{report, run};
use randt_messages::{RadarPoints, StageHealthTopic, StageState, health::text_of};
use randt_stage::{Domain, Observer, Registry};
use rustix::process::{Pid, Resource, Rlimit, Signal, prlimit};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const STAGES: [&str; 7] = [
    "radar", "imu", "filter", "odometry", "mapper", "recorder", "view",
];
/// A stage that cannot go on has reported it and ended by then.
const END_MAX: Duration = Duration::from_secs(10);
/// A driver reports what is wrong, and that all is well again, within 2 s; a busy machine has as
/// much again.
const REPORTED_MAX_S: f64 = 4.0;

/// Lowers what a process may have of something; the hard limit stays.
fn limit(pid: u32, resource: Resource, current: u64) {
    let pid = Pid::from_raw(pid as i32);
    let new = |maximum| Rlimit {
        current: Some(current),
        maximum,
    };
    let maximum = rustix::process::getrlimit(resource).maximum;
    prlimit(pid, resource, new(maximum)).unwrap();
}

/// Processes of the stages that live.
fn pids(domain: &Domain) -> BTreeMap<String, u32> {
    let living = Registry::all(domain)
        .into_iter()
        .filter(|(_, lives)| *lives);
    living
        .map(|(entry, _)| (entry.name, entry.pid as u32))
        .collect()
}

/// `randt up`; killed where a test fails before it ends.
struct Up(Child);

impl Up {
    fn start(mut command: Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::null());
        Self(command.spawn().unwrap())
    }

    fn code(&mut self) -> Option<i32> {
        self.0.wait().unwrap().code()
    }
}

impl Drop for Up {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// `randt up --play` of a log, at a rate, recorded; its files go to `up` and `logs`.
fn up(own: &Pipeline, log: &Path, folder: &Path, rate: &str) -> Up {
    let mut command = own.command(&["up"]);
    command.args(["--rate", rate, "--play"]).arg(log);
    command.arg("--out").arg(folder.join("up"));
    command.arg("--record").arg(folder.join("logs"));
    Up::start(command)
}

#[test]
fn a_stage_without_descriptors_reports_it_at_its_start() {
    let folder = RunFolder::new();
    let domain = folder.domain("ra");
    let robot = Sensors::new(folder.file("").as_path(), "beam-udp", "mip").robot();
    for stage in STAGES {
        let mut command = Command::new("prlimit");
        command.arg("--nofile=24:24").arg(program(stage));
        command.args(["--prefix", domain.prefix(), "--run"]);
        command.arg(domain.run());
        match stage {
            "radar" | "imu" => _ = command.arg("--robot").arg(&robot),
            "mapper" => _ = command.arg("--journal").arg(folder.file("map.journal")),
            "recorder" => _ = command.arg("--out").arg(folder.file("logs")),
            _ => {}
        }
        let mut running = folder.start(stage, command);
        let status = running.wait(END_MAX);
        let output = running.stderr();
        assert_eq!(status.code(), Some(1), "{stage}: {output}");
        assert!(output.contains("out of descriptors"), "{stage}: {output}");
    }
}

#[test]
fn a_stage_that_runs_out_of_descriptors_ends_instead_of_going_deaf() {
    let run_folder = RunFolder::new();
    let domain = run_folder.domain("rb");
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 100);
    let mut filter = run_folder.start("filter", RunFolder::command(&domain, "filter"));
    until("the filter", || filter.stderr().contains("radar/points/v1"));
    std::thread::sleep(Duration::from_millis(500));
    limit(filter.pid(), Resource::Nofile, 5);
    // A stage that starts now is out of its reach.
    let mut play = RunFolder::command(&domain, "play");
    play.arg(&log).arg("--loop");
    let _play = run_folder.start("play", play);
    let status = filter.wait(END_MAX);
    let output = filter.stderr();
    assert_eq!(status.code(), Some(1), "{output}");
    assert!(output.contains("out of descriptors"), "{output}");
    // Started again it has all that is in reach.
    let _filter = run_folder.start("filter", RunFolder::command(&domain, "filter"));
    let observer = Observer::enter(&domain).unwrap().unwrap();
    let mut points = observer.subscriber::<RadarPoints>().unwrap();
    let mut came = 0;
    until("points", || {
        observer.read(&mut points, |_| came += 1).unwrap();
        came > 5
    });
}

#[test]
fn stages_that_get_no_more_memory_end_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let offline = run(&log, &folder.path().join("run"), &[]);
    assert_eq!(offline.code, Some(0), "{}", offline.stderr);
    let own = Pipeline::new("rm");
    let mut up = up(&own, &log, folder.path(), "1");
    let names = ["filter", "odometry", "mapper", "recorder"];
    until("play", || pids(own.domain()).contains_key("play"));
    std::thread::sleep(Duration::from_secs(3));
    for (name, pid) in pids(own.domain()) {
        if names.contains(&name.as_str()) {
            limit(pid, Resource::As, 1);
        }
    }
    let code = up.code();
    assert!([Some(0), Some(3)].contains(&code), "{code:?}");
    let live = report(&folder.path().join("up"));
    println!("exit code {code:?}, {}", live["counters"]);
    assert_eq!(live["scans"], report(&folder.path().join("run"))["scans"]);
    assert!(
        same(folder.path()) || late(&live) > 0,
        "{}",
        live["counters"]
    );
}

/// Scans that had less of the IMU than there was, by a report.
fn late(report: &serde_json::Value) -> u64 {
    let counter = &report["counters"]["odometry_scans_imu_late"]["count"];
    counter.as_u64().unwrap_or(0)
}

/// Whether `up` left the poses of `run`.
fn same(folder: &Path) -> bool {
    let [up, run] = ["up", "run"].map(|name| fs::read(folder.join(name).join("odometry.tum")));
    up.unwrap() == run.unwrap()
}

#[test]
fn a_mapper_that_the_kernel_kills_for_want_of_memory_comes_back() {
    let Some(group) = Group::new("memory") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let offline = run(&log, &folder.path().join("run"), &PATIENT);
    assert_eq!(offline.code, Some(0), "{}", offline.stderr);
    let own = Pipeline::new("rk");
    let mut command = crate::support::up::up(own.domain(), &log, &folder.path().join("up"));
    command.arg("--record").arg(folder.path().join("logs"));
    let mut up = Up::start(command);
    until("play", || pids(own.domain()).contains_key("play"));
    std::thread::sleep(Duration::from_secs(2));
    // It grows with the map. What it has stays; the next page is one too many.
    group.limit_memory(8192);
    group.take(pids(own.domain())["mapper"]);
    until("the kernel kills it", || group.killed() > 0);
    let code = up.code();
    let live = report(&folder.path().join("up"));
    println!("exit code {code:?}, {}", live["counters"]);
    assert_eq!(code, Some(0));
    for name in ["odometry.tum", "keyframes.tum", "trajectory.tum", "map.pgm"] {
        let [up, run] = ["up", "run"].map(|of| fs::read(folder.path().join(of).join(name)));
        assert!(up.unwrap() == run.unwrap(), "{name} differs");
    }
}

/// Takes the processor from processes, and gives it back.
type Starve<'a> = &'a dyn Fn(&BTreeMap<String, u32>, bool);

#[test]
fn a_pipeline_that_stands_for_five_seconds_reports_what_that_cost() {
    starved_for_five_seconds("rs", &|pids, is_starved| {
        let stop_or_go = if is_starved {
            Signal::STOP
        } else {
            Signal::CONT
        };
        pids.values().for_each(|pid| signal(*pid, stop_or_go));
    });
}

#[test]
fn a_pipeline_that_gets_no_processor_for_five_seconds_reports_what_that_cost() {
    let Some(group) = Group::new("cpu") else {
        return;
    };
    starved_for_five_seconds("rc", &|pids, is_starved| {
        // A thousandth of a second every tenth of one, for all together.
        group.limit_processor(is_starved.then_some(0.01));
        pids.values().for_each(|pid| group.take(*pid));
    });
}

fn starved_for_five_seconds(prefix: &str, starve: Starve<'_>) {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let offline = run(&log, &folder.path().join("run"), &[]);
    assert_eq!(offline.code, Some(0), "{}", offline.stderr);
    let own = Pipeline::new(prefix);
    let mut up = up(&own, &log, folder.path(), "1");
    until("play", || pids(own.domain()).contains_key("play"));
    std::thread::sleep(Duration::from_secs(4));
    let mut stages = pids(own.domain());
    stages.remove("up");
    starve(&stages, true);
    std::thread::sleep(Duration::from_secs(5));
    starve(&stages, false);
    let code = up.code();
    assert!([Some(0), Some(3)].contains(&code), "{code:?}");
    let live = report(&folder.path().join("up"));
    println!("exit code {code:?}, {}", live["counters"]);
    let offline = report(&folder.path().join("run"));
    assert_eq!(live["scans"], offline["scans"]);
    assert_eq!(live["counters"]["messages_lost"], serde_json::Value::Null);
    // Either nothing has changed, or it reports the change.
    assert!(
        same(folder.path()) || late(&live) > late(&offline),
        "{}",
        live["counters"]
    );
    // The log of it gives what was lived.
    let logs = crate::support::names(&folder.path().join("logs"));
    let recorded = folder.path().join("logs").join(&logs[0]);
    let again = run(&recorded, &folder.path().join("again"), &["--compare"]);
    assert_eq!(again.code, Some(0), "{}{}", again.stdout, again.stderr);
}

#[test]
fn sensors_that_are_unplugged_and_plugged_in_again_are_reported_and_leave_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 75);
    let sensors = Sensors::new(folder.path(), "beam-udp", "mip");
    let own = Pipeline::new("ru");
    let mut command = own.command(&["up"]);
    command
        .arg("--robot")
        .arg(sensors.robot())
        .arg("--out")
        .arg(folder.path().join("up"));
    let mut up = Up::start(command);
    let begin_s = unix_s() + 4.0;
    let second = format!("{begin_s:.3}");
    let fault = ["--at", &second, "--fault", "unplug@6+3"];
    let mut emulators = [sensors.radar(&log, &fault), sensors.imu(&log, &fault)];
    let (gone_s, back_s) = (begin_s + 6.0, begin_s + 9.0);

    // Health as it comes: the driver, when, and whether it reports that something is wrong.
    let mut output: Vec<(String, f64, bool)> = Vec::new();
    until("the drivers", || pids(own.domain()).contains_key("radar"));
    let observer = Observer::enter(own.domain()).unwrap().unwrap();
    let mut health = observer.subscriber::<StageHealthTopic>().unwrap();
    let begin = Instant::now();
    while !emulators.iter_mut().all(Emulator::ended) {
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "the emulators do not end"
        );
        let read = observer.read(&mut health, |message| {
            let head = message.head;
            let is_wrong = head.state == StageState::Degraded as u32;
            output.push((text_of(&head.name).to_owned(), unix_s(), is_wrong));
        });
        read.unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    signal(up.0.id(), Signal::INT);
    let code = up.code();
    let live = report(&folder.path().join("up"));
    println!(
        "exit code {code:?}, {}, {}",
        live["frames"], live["counters"]
    );
    for driver in ["radar", "imu"] {
        let after = |from_s: f64, is_wrong: bool| {
            let mut of = output.iter().filter(|(name, ..)| name == driver);
            let found = of.find(|(_, at_s, wrong)| *at_s > from_s && *wrong == is_wrong);
            found.map_or(f64::INFINITY, |(_, at_s, _)| at_s - from_s)
        };
        let (gone, back) = (after(gone_s, true), after(back_s, false));
        println!("{driver}: reported after {gone:.2} s, well again after {back:.2} s");
        assert!(gone < REPORTED_MAX_S && back < REPORTED_MAX_S, "{driver}");
    }
    // A hole in the samples is lost data; the radar's sweeps of these three seconds were never
    // measured.
    assert_eq!(code, Some(3));
    let frames = live["frames"].as_array().unwrap();
    assert!(frames.len() >= 2, "{frames:?}");
    for counter in ["odometry_frames_reopened", "odometry_imu_holes"] {
        let count = live["counters"][counter]["count"].as_u64();
        assert!(count.unwrap_or(0) >= 1, "{counter}");
    }
}
