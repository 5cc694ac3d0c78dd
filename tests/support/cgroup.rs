//! A control group of its own: what the kernel gives to the processes in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Where control groups are mounted, by controller in the first version, one tree in the second.
const ROOT: &str = "/sys/fs/cgroup";
/// The time in which a share of a processor is given, µs.
const PERIOD_US: u32 = 100_000;

/// A group of one controller; it is removed when its processes are gone.
pub struct Group {
    folder: PathBuf,
    is_first_version: bool,
}

impl Group {
    /// A group of `memory` or `cpu`; prints a line where this user may make none, or the system
    /// has none.
    pub fn new(controller: &str) -> Option<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("randt-test-{}-{count}", std::process::id());
        let first = Path::new(ROOT).join(controller);
        let is_first_version = first.is_dir();
        let root = if is_first_version { first } else { ROOT.into() };
        if !is_first_version {
            // It may be enabled already.
            let _ = fs::write(
                root.join("cgroup.subtree_control"),
                format!("+{controller}"),
            );
        }
        let group = Self {
            folder: root.join(name),
            is_first_version,
        };
        let made = fs::create_dir(&group.folder).is_ok();
        let is_there = made && group.folder.join(group.limit(controller)).exists();
        if !is_there {
            println!("not run: there are no control groups for {controller} here");
        }
        is_there.then_some(group)
    }

    fn limit(&self, controller: &str) -> &'static str {
        match (controller, self.is_first_version) {
            ("memory", true) => "memory.limit_in_bytes",
            ("memory", false) => "memory.max",
            (_, true) => "cpu.cfs_quota_us",
            (_, false) => "cpu.max",
        }
    }

    fn set(&self, controller: &str, value: &str) {
        let file = self.folder.join(self.limit(controller));
        fs::write(&file, value).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    }

    /// What its processes may take from now on, bytes.
    pub fn limit_memory(&self, bytes: u64) {
        self.set("memory", &bytes.to_string());
    }

    /// The share of one processor that its processes get; `None`: all they ask for.
    pub fn limit_processor(&self, share: Option<f64>) {
        let quota = share.map(|share| (share * f64::from(PERIOD_US)) as u32);
        let value = match (quota, self.is_first_version) {
            (Some(quota), true) => quota.to_string(),
            (None, true) => "-1".to_owned(),
            (Some(quota), false) => format!("{quota} {PERIOD_US}"),
            (None, false) => format!("max {PERIOD_US}"),
        };
        self.set("cpu", &value);
    }

    /// Moves a process into it.
    pub fn take(&self, pid: u32) {
        fs::write(self.folder.join("cgroup.procs"), pid.to_string()).unwrap();
    }

    /// Processes that the kernel has killed because memory was short.
    pub fn killed(&self) -> u64 {
        let file = if self.is_first_version {
            "memory.oom_control"
        } else {
            "memory.events"
        };
        let text = fs::read_to_string(self.folder.join(file)).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("oom_kill "));
        line.unwrap().parse().unwrap()
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        // Best effort: a test that failed may have left a process in it.
        let _ = fs::remove_dir(&self.folder);
    }
}
