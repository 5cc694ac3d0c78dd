//! Shared memory that goes away while the pipeline runs: removed, cut, or filled by others. Every
//! stage notices it within two seconds and reports it; started again, the pipeline goes on where
//! it was.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::stages::{RunFolder, Running};
use crate::support::up::up;
use crate::support::{drive, ended, ended_within, randt, remove_folder, report, tum};
use randt_stage::{Domain, Registry};
use rustix::process::{Pid, Signal, kill_process};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A stage notices within this time that its memory is gone; the rest is for a busy machine.
const NOTICED_MAX: Duration = Duration::from_secs(2);
const BUSY: Duration = Duration::from_secs(3);
/// What is waited for comes within this time, or never.
const WAIT_MAX: Duration = Duration::from_secs(20);
/// In the order in which they are started.
const STAGES: [&str; 3] = ["mapper", "odometry", "filter"];

/// Files of a domain in /dev/shm that end so.
fn segments(domain: &Domain, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    let names = entries.map(|entry| entry.file_name().into_string().unwrap());
    let own = names.filter(|name| name.starts_with(&domain.segment_prefix()));
    own.filter(|name| name.ends_with(ending))
        .map(|name| Path::new("/dev/shm").join(name))
        .collect()
}

/// Removes them. The stages live, so that one may be gone before its turn.
fn remove_segments(domain: &Domain, ending: &str) {
    for path in segments(domain, ending) {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                panic!("{}: {error}", path.display())
            }
            _ => {}
        }
    }
}

/// The stages, and a player that stays.
struct Stages {
    // Ended before the folder is wiped: fields are dropped in order.
    running: Vec<Running>,
    folder: RunFolder,
    domain: Domain,
}

impl Stages {
    fn start(log: &Path, name: &str) -> Self {
        let folder = RunFolder::new();
        let domain = folder.domain(name);
        let mut stages = Self {
            folder,
            domain,
            running: Vec::new(),
        };
        stages.start_again();
        let mut command = RunFolder::command(&stages.domain, "play");
        command.arg(log).arg("--stay");
        stages.add("play", command);
        stages
    }

    /// Starts every stage.
    fn start_again(&mut self) {
        for name in STAGES {
            let mut command = RunFolder::command(&self.domain, name);
            if name == "mapper" {
                command
                    .arg("--journal")
                    .arg(self.folder.file("map.journal"));
            }
            self.add(name, command);
        }
    }

    fn add(&mut self, name: &str, command: Command) {
        let mut started = self.folder.start(name, command);
        let pid = u64::from(started.pid());
        let runs = |(entry, lives): &(randt_stage::Entry, bool)| {
            *lives && entry.pid == pid && entry.topics.len() > 1
        };
        until(name, || {
            let ended = started.ended();
            assert!(ended.is_none(), "{name}: {ended:?}: {}", started.stderr());
            Registry::all(&self.domain).iter().any(runs)
        });
        self.running.retain(|running| running.name != name);
        self.running.push(started);
    }

    /// Waits until every stage has ended by itself; gives what each has written, and the longest
    /// time.
    fn all_end(&mut self) -> (Vec<(String, std::process::ExitStatus, String)>, Duration) {
        let begin = Instant::now();
        let stages = self.running.iter_mut().filter(|stage| stage.name != "play");
        let ended = stages.map(|stage| {
            let status = stage.wait(NOTICED_MAX + BUSY);
            (stage.name.clone(), status, stage.stderr())
        });
        (ended.collect(), begin.elapsed())
    }

    /// What `randt top` sees.
    fn top(&self) -> serde_json::Value {
        let mut command = randt(&["top", "--once", "--json", "--prefix", self.domain.prefix()]);
        command.arg("--run").arg(self.domain.run());
        let top = ended(command);
        serde_json::from_str(&top.stdout).unwrap_or_else(|error| panic!("{error}: {}", top.stderr))
    }

    /// Waits until new poses come; gives the odometry frame.
    fn poses_come(&self) -> u64 {
        let begin = Instant::now();
        loop {
            let top = self.top();
            let robot = &top["robot"];
            if robot["age_s"].as_f64().is_some_and(|age_s| age_s < 1.0) {
                return robot["odom_frame_id"].as_u64().unwrap();
            }
            assert!(begin.elapsed() < WAIT_MAX, "no pose comes: {top:#}");
        }
    }
}

#[test]
fn memory_that_is_removed_is_noticed_by_all_and_the_pipeline_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 300);
    let mut stages = Stages::start(&log, "gone");
    let frame = stages.poses_come();
    for ending in ["", ".data", ".dynamic"] {
        // One is stopped meanwhile, so that people can look at it.
        let filter = stages.running.iter().find(|stage| stage.name == "filter");
        let filter = Pid::from_raw(filter.unwrap().pid() as i32).unwrap();
        kill_process(filter, Signal::STOP).unwrap();
        remove_segments(&stages.domain, ending);
        let mut doctor = randt(&["doctor", "--prefix", stages.domain.prefix(), "--run"]);
        doctor.arg(stages.domain.run());
        let doctor = ended(doctor);
        assert!(
            doctor
                .stdout
                .contains("shared memory of living stages is gone: randt-filter"),
            "{}",
            doctor.stdout
        );
        assert_eq!(doctor.code, Some(1));
        kill_process(filter, Signal::CONT).unwrap();
        let (ended, after) = stages.all_end();
        println!("removed *{ending}: all have ended after {after:?}");
        for (name, status, output) in ended {
            assert_eq!(status.code(), Some(1), "{name}: {output}");
            assert!(output.contains("was removed or cut"), "{name}: {output}");
        }
        stages.start_again();
        assert_eq!(stages.poses_come(), frame, "odometry goes on in its frame");
    }
    let player = stages.running.iter_mut().find(|stage| stage.name == "play");
    assert!(player.unwrap().ended().is_none(), "the player goes on");
    let map = stages.top()["map"].clone();
    assert!(map["keyframes"].as_u64().unwrap() > 0, "{map}");
}

#[test]
fn a_run_folder_that_is_removed_is_noticed_by_all() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    for (name, inside) in [("nodes", "bus/nodes"), ("bus", "bus"), ("all", "")] {
        let mut stages = Stages::start(&log, name);
        remove_folder(&stages.domain.folder().join(inside));
        let (ended, after) = stages.all_end();
        println!("removed {inside:?}: all have ended after {after:?}");
        for (name, status, output) in ended {
            assert_eq!(status.code(), Some(1), "{name}: {output}");
            assert!(output.contains("was removed or cut"), "{name}: {output}");
        }
        stages.start_again();
        stages.poses_come();
    }
}

#[test]
fn memory_that_is_cut_keeps_no_stage_from_starting() {
    let mut pipeline = Pipeline::new("cut");
    for (ending, bytes) in [
        (".global_mgmt", 0),
        (".global_mgmt", 7),
        (".dynamic", 0),
        (".dynamic", 300),
        (".dynamic", 5000),
        (".data", 0),
        (".connection", 0),
    ] {
        let filter = pipeline.stage("filter");
        let odometry = pipeline.stage("odometry");
        for path in segments(pipeline.domain(), ending) {
            let file = File::options().write(true).open(path).unwrap();
            file.set_len(bytes).unwrap();
        }
        let begin = Instant::now();
        let mapper = pipeline.stage("mapper");
        println!(
            "*{ending} of {bytes} bytes: starts in {:?}",
            begin.elapsed()
        );
        assert!(begin.elapsed() < NOTICED_MAX + BUSY);
        for pid in [filter, odometry, mapper] {
            // One that has ended by itself is no loss here.
            let _ = kill_process(Pid::from_raw(pid as i32).unwrap(), Signal::KILL);
        }
        pipeline.kill_all();
    }
}

#[test]
fn up_lives_through_the_removal_of_its_memory_and_writes_its_results() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 60);
    let own = Pipeline::new("up");
    let out = folder.path().join("up");
    let mut child = up(own.domain(), &log, &out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let plays = |(entry, lives): &(randt_stage::Entry, bool)| *lives && entry.name == "play";
    until("play", || Registry::all(own.domain()).iter().any(plays));
    std::thread::sleep(Duration::from_secs(3));
    remove_segments(own.domain(), "");
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("randt up hangs");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!(status.code(), Some(3), "finished, and something was lost");
    assert_eq!(report(&out)["counters"]["memory_gone"]["count"], 1);
    let poses = tum(&out.join("odometry.tum")).len();
    println!("{poses} of 60 scans have a pose");
    assert!(poses >= 30);
}

/// Tells this program that it runs in the small world, and where the log is.
const LOG: &str = "RANDT_TEST_FILLED_LOG";
/// Room for the stages, and some that others take.
const SIZE_KB: u32 = 64_000;
const SCANS: u64 = 60;
const RATE: f64 = 6.0;

#[test]
fn memory_that_others_fill_ends_no_stage() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&drive::events(SCANS), &log);
    let mounts = Command::new("unshare").args(["-m", "true"]).status();
    if !mounts.is_ok_and(|status| status.success()) {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI may make its own mounts"
        );
        println!("not run: this user may not make its own mounts");
        return;
    }
    let script = format!("mount -t tmpfs -o size={SIZE_KB}k tmpfs /dev/shm && exec \"$0\" \"$@\"");
    let mut command = Command::new("unshare");
    command.args(["-m", "sh", "-c", &script]);
    command.arg(std::env::current_exe().unwrap());
    command.args([
        "shared_memory::in_the_small_world",
        "--exact",
        "--nocapture",
    ]);
    command.env(LOG, &log);
    let ended = ended_within(command, Duration::from_secs(90));
    println!("{}", ended.stdout);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
}

#[test]
fn in_the_small_world() {
    let Some(log) = std::env::var_os(LOG).map(PathBuf::from) else {
        return;
    };
    let folder = RunFolder::new();
    let domain = folder.domain("filled");
    let (profile, _) = folder.profile(&log);
    let start = |name: &str| {
        let mut command = RunFolder::command(&domain, name);
        match name {
            "play" => command
                .args(["--stay", "--rate", &RATE.to_string()])
                .arg(&log),
            "mapper" => command.arg("--journal").arg(folder.file("map.journal")),
            _ => command.arg("--profile").arg(&profile),
        };
        folder.start(name, command)
    };
    let runs = |pid: u32| {
        let all = Registry::all(&domain);
        all.iter()
            .any(|(entry, lives)| *lives && entry.pid == u64::from(pid) && entry.topics.len() > 1)
    };
    let mut programs: Vec<Running> = Vec::new();
    for name in ["mapper", "odometry", "filter", "play"] {
        let program = start(name);
        until(name, || runs(program.pid()));
        programs.push(program);
    }
    std::thread::sleep(Duration::from_millis(500));
    // Somebody takes all that is left, while most of the scans are still to come.
    let filler = File::create("/dev/shm/filler").unwrap();
    let mut taken = 0;
    for step in [1 << 20, 1 << 12] {
        let flags = rustix::fs::FallocateFlags::empty();
        while rustix::fs::fallocate(&filler, flags, taken, step).is_ok() {
            taken += step;
        }
    }
    println!("{taken} bytes are taken by somebody");
    std::thread::sleep(Duration::from_secs_f64(SCANS as f64 / 5.0 / RATE + 1.0));
    for program in &mut programs {
        let ended = program.ended();
        assert!(
            ended.is_none(),
            "{}: {ended:?}: {}",
            program.name,
            program.stderr()
        );
    }
    // One that is killed has no room to come back, because its readers still hold what it sent; it
    // says so.
    let filter = programs.iter_mut().find(|program| program.name == "filter");
    let filter = filter.unwrap();
    kill_process(Pid::from_raw(filter.pid() as i32).unwrap(), Signal::KILL).unwrap();
    filter.wait(WAIT_MAX);
    *filter = start("filter");
    let status = filter.wait(WAIT_MAX);
    assert_eq!(status.code(), Some(1), "{status}: {}", filter.stderr());
    assert!(filter.stderr().contains("MB free"), "{}", filter.stderr());
    // As soon as there is room it runs.
    drop(filler);
    fs::remove_file("/dev/shm/filler").unwrap();
    *filter = start("filter");
    until("filter", || runs(filter.pid()));
    for program in &mut programs {
        let status = program.stop();
        assert_eq!(
            status.signal(),
            None,
            "{}: {}",
            program.name,
            program.stderr()
        );
        assert!(status.success(), "{}: {}", program.name, program.stderr());
    }
}
