//! The stages as processes in a domain of their own, each started by hand, and what the system
//! reports of them.

use randt_config::{Config, Selection};
use randt_stage::Domain;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Where shared memory lives; the run folder lies there too, as on a robot.
const SHARED_MEMORY: &str = "/dev/shm";
/// A process that does not end on SIGTERM within this time never will.
const END_MAX: Duration = Duration::from_secs(60);

/// Programs started so far by this process.
static STARTED: AtomicU32 = AtomicU32::new(0);

/// A run folder for one test.
pub struct RunFolder {
    memory: TempDir,
    /// Logs and the programs' output lie on the disk: memory may be short in a test.
    files: TempDir,
}

/// A started program. It is killed where a test fails before it ends.
pub struct Running {
    pub name: String,
    child: Child,
    errors: PathBuf,
}

/// The program of a stage, or `randt` for `play`.
pub fn program(name: &str) -> PathBuf {
    match name {
        "play" => Path::new(env!("CARGO_BIN_EXE_randt")).to_owned(),
        _ => beside(&format!("randt-{name}")),
    }
}

/// A program that stands beside `randt`.
pub fn beside(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_BIN_EXE_randt")).with_file_name(name);
    assert!(
        path.is_file(),
        "{}: not there; cargo build --workspace makes it",
        path.display()
    );
    path
}

impl RunFolder {
    pub fn new() -> Self {
        let memory = tempfile::Builder::new()
            .prefix("rt-")
            .tempdir_in(SHARED_MEMORY)
            .unwrap();
        let files = tempfile::tempdir().unwrap();
        Self { memory, files }
    }

    /// The run folder.
    pub fn run(&self) -> PathBuf {
        self.memory.path().to_owned()
    }

    /// A file that is not in memory.
    pub fn file(&self, name: &str) -> PathBuf {
        self.files.path().join(name)
    }

    /// The world of a prefix, which no other test may use.
    pub fn domain(&self, prefix: &str) -> Domain {
        Domain::new(
            &format!("{prefix}-{}", std::process::id()),
            Some(&self.run()),
        )
        .unwrap()
    }

    /// The configuration for a log as a file, with the mounting that the log has.
    pub fn profile(&self, log: &Path) -> (PathBuf, Config) {
        let source = randt_readers::open(log, &randt_readers::Options::default()).unwrap();
        let selection = Selection {
            sensor_from_input: source.info().sensor.name(),
            ..Selection::default()
        };
        let loaded = randt::job::with_mounting(Config::load(&selection).unwrap(), source.as_ref());
        let path = self.file("profile.toml");
        fs::write(&path, loaded.to_toml()).unwrap();
        (path, loaded.config)
    }

    /// A stage, or `play`, ready for more arguments.
    pub fn command(domain: &Domain, name: &str) -> Command {
        let mut command = Command::new(program(name));
        if name == "play" {
            command.arg("play");
        }
        command.args(["--prefix", domain.prefix(), "--run"]);
        command.arg(domain.run());
        command
    }

    /// Starts it.
    pub fn start(&self, name: &str, mut command: Command) -> Running {
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let errors = self.file(&format!("{name}.{number}.errors"));
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(&errors).unwrap())
            .spawn()
            .unwrap_or_else(|error| panic!("{command:?}: {error}"));
        Running {
            name: name.to_owned(),
            child,
            errors,
        }
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        // Segments lie beside the run folder, by the domains' prefixes.
        for entry in fs::read_dir(self.run()).into_iter().flatten().flatten() {
            let prefix = entry.file_name().to_string_lossy().into_owned();
            let domain = Domain::new(&prefix, Some(&self.run()));
            // Best effort: a test that failed may have left something that lives.
            let _ = domain.map(|domain| randt_stage::wipe(&domain, true));
        }
    }
}

impl Running {
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// What it has written to standard error so far.
    pub fn stderr(&self) -> String {
        fs::read_to_string(&self.errors).unwrap()
    }

    /// How it ended, where it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().unwrap()
    }

    /// Waits for its own end.
    pub fn wait(&mut self, time_max: Duration) -> ExitStatus {
        let begin = Instant::now();
        loop {
            if let Some(status) = self.ended() {
                return status;
            }
            assert!(
                begin.elapsed() < time_max,
                "randt-{}: not ended after {time_max:?}: {}",
                self.name,
                self.stderr()
            );
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Ends it.
    pub fn stop(&mut self) -> ExitStatus {
        if let Some(pid) = rustix::process::Pid::from_raw(self.pid() as i32)
            && self.ended().is_none()
        {
            rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        }
        self.wait(END_MAX)
    }

    /// Bytes that went through write() so far; what is sent through sockets is not among them.
    pub fn written(&self) -> u64 {
        let text = fs::read_to_string(format!("/proc/{}/io", self.pid())).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("wchar: "));
        line.unwrap().parse().unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            // It may end in this moment.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Memory in use by a domain: its segments, iceoryx2's files, and what survives the stages.
/// Blocks, not lengths.
pub fn memory(domain: &Domain) -> u64 {
    let segments = randt_stage::leftovers(domain);
    let segments: u64 = segments.iter().map(|leftover| leftover.bytes).sum();
    let state = fs::read_dir(domain.state()).into_iter().flatten().flatten();
    let state = state.filter_map(|entry| entry.metadata().ok());
    segments
        + state
            .map(|found| std::os::unix::fs::MetadataExt::blocks(&found) * 512)
            .sum::<u64>()
}
