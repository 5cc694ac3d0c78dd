//! Stages of a domain of its own, as processes.

use super::stages::program;
use super::{Ended, ended, randt};
use randt_stage::{Domain, Registry};
use rustix::process::{Pid, Signal, kill_process};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Nothing is waited for longer.
const WAIT_MAX: Duration = Duration::from_secs(60);

/// Processes in a domain; all of it goes with this.
pub struct Pipeline {
    domain: Domain,
    children: Vec<Child>,
    _run: tempfile::TempDir,
}

impl Pipeline {
    /// A domain in which nobody is yet, with its run folder in memory.
    pub fn new(name: &str) -> Self {
        Self::below(name, Path::new("/dev/shm"))
    }

    /// The same with its run folder somewhere else.
    pub fn below(name: &str, folder: &Path) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let mut run = tempfile::Builder::new();
        let run = run.prefix("randt-test-").tempdir_in(folder).unwrap();
        let prefix = format!("{name}-{}-{count}", std::process::id());
        Self {
            domain: Domain::new(&prefix, Some(run.path())).unwrap(),
            children: Vec::new(),
            _run: run,
        }
    }

    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// A command of randt for this domain.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = randt(arguments);
        self.enter(&mut command);
        command
    }

    /// Runs one to its end.
    pub fn randt(&self, arguments: &[&str]) -> Ended {
        ended(self.command(arguments))
    }

    /// Starts a stage's own program; gives its process.
    pub fn stage(&mut self, name: &str) -> u32 {
        let mut command = Command::new(program(name));
        self.enter(&mut command);
        self.start(name, command)
    }

    /// Starts the stages that compute; the map's journal lies in the folder.
    pub fn compute(&mut self, folder: &Path) {
        self.mapper(&folder.join("map.journal"));
        self.stage("odometry");
        self.stage("filter");
    }

    /// Starts the mapper.
    pub fn mapper(&mut self, journal: &Path) -> u32 {
        self.mapper_by(journal, &[])
    }

    /// Starts the mapper with more options.
    pub fn mapper_by(&mut self, journal: &Path, more: &[&str]) -> u32 {
        let mut command = Command::new(program("mapper"));
        self.enter(&mut command);
        command.arg("--journal").arg(journal).args(more);
        self.start("mapper", command)
    }

    /// Starts the recorder.
    pub fn record(&mut self, folder: &Path, more: &[&str]) -> u32 {
        let mut command = Command::new(program("recorder"));
        self.enter(&mut command);
        command.arg("--out").arg(folder).args(more);
        self.start("recorder", command)
    }

    /// Starts `randt play`.
    pub fn play(&mut self, log: &Path, more: &[&str]) -> u32 {
        let mut command = self.command(&["play"]);
        command.arg(log).args(more);
        self.start("play", command)
    }

    /// Adds the options that lead here.
    pub fn enter(&self, command: &mut Command) {
        command.args(["--prefix", self.domain.prefix(), "--run"]);
        command.arg(self.domain.run());
    }

    /// Starts a program and waits until it is in its loop: it holds the lock of those who start
    /// until then.
    pub fn start(&mut self, name: &str, mut command: Command) -> u32 {
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.stderr(Stdio::null()).spawn().unwrap();
        let pid = child.id();
        self.children.push(child);
        let is = |(entry, lives): &(randt_stage::Entry, bool)| {
            *lives && entry.name == name && entry.pid == u64::from(pid) && entry.topics.len() > 1
        };
        until(name, || Registry::all(&self.domain).iter().any(is));
        let starts = self.domain.folder().join("start.lock");
        until(name, || File::open(&starts).unwrap().try_lock().is_ok());
        pid
    }

    /// Ends a process and waits until it is gone; gives its exit code, where it has one.
    pub fn end(&mut self, pid: u32, with: Signal) -> Option<i32> {
        signal(pid, with);
        let child = self.children.iter_mut().find(|child| child.id() == pid);
        child.unwrap().wait().unwrap().code()
    }

    /// Kills all that live.
    pub fn kill_all(&mut self) {
        for child in &mut self.children {
            // One that has ended cannot be killed.
            let _ = child.kill();
            child.wait().unwrap();
        }
    }

    /// Ends all in order, the last one to start first.
    pub fn end_all(&mut self) {
        let pids: Vec<u32> = self.children.iter().map(Child::id).collect();
        for pid in pids.into_iter().rev() {
            self.end(pid, Signal::TERM);
        }
    }

    /// Names in /dev/shm that are this domain's.
    pub fn segments(&self) -> Vec<String> {
        let mut names = super::names(Path::new("/dev/shm"));
        names.retain(|name| name.starts_with(&self.domain.segment_prefix()));
        names
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.kill_all();
        for name in self.segments() {
            let _ = std::fs::remove_file(Path::new("/dev/shm").join(name));
        }
    }
}

/// Sends a signal.
pub fn signal(pid: u32, signal: Signal) {
    kill_process(Pid::from_raw(pid as i32).unwrap(), signal).unwrap();
}

/// Waits until something holds.
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < WAIT_MAX, "{what}: waited for in vain");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A log of that many scans at 5 Hz, with 250 Hz of IMU.
pub fn log(folder: &Path, scans: u32) -> PathBuf {
    log_of(folder, scans, 1)
}

/// The same, of one of many drives.
pub fn log_of(folder: &Path, scans: u32, seed: u32) -> PathBuf {
    let path = folder.join(format!("log-{seed}.mcap"));
    let mut command = randt(&["simulate", "building"]);
    command.args(["--seed", &seed.to_string(), "--scans", &scans.to_string()]);
    command.arg("--out").arg(&path);
    let made = ended(command);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    path
}
