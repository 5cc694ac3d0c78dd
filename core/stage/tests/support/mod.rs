//! A second process: this test program once more, running one of its tests as another process.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test reports a failure by panicking"
)]

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Marks the second process, and names the pipeline's run folder.
const RUN: &str = "RANDT_TEST_RUN";

/// How long a copy may take until another user can run it.
const COPY_MAX: Duration = Duration::from_secs(20);

/// The second process, once it is ready.
pub struct Other {
    child: Child,
}

/// The pipeline's run folder; `None` in the first process.
pub fn pipeline_folder() -> Option<PathBuf> {
    std::env::var_os(RUN).map(PathBuf::from)
}

/// The command that runs a test of `program`, a copy of this one, as the second process.
pub fn command(program: &Path, test: &str, run: &Path) -> Command {
    let mut command = Command::new(program);
    command.args([test, "--exact", "--nocapture"]);
    command.env(RUN, run);
    command
}

/// The same as another user, who may run any program that all users may run.
pub fn command_as(user: u32, program: &Path, test: &str, run: &Path) -> Command {
    let other = command(program, test, run);
    let mut command = Command::new("setpriv");
    let id = user.to_string();
    command.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
    command.arg(other.get_program()).args(other.get_args());
    let set = other.get_envs();
    command.envs(set.filter_map(|(key, value)| Some((key, value?))));
    command
}

/// A copy of this program that all users may run, in any folder. None if this user cannot become
/// another one, which is printed.
pub fn program_for_all(folder: &Path) -> Option<PathBuf> {
    if !rustix::process::geteuid().is_root() {
        assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
        println!("not run: this user is not root");
        return None;
    }
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755)).unwrap();
    let program = folder.join("program");
    let begin = Instant::now();
    while let Err(error) = copy_for_all(&program) {
        assert!(begin.elapsed() < COPY_MAX, "{error}");
        println!("{error}");
    }
    Some(program)
}

/// Copies it, and has another user run it. Once, on a busy machine, that user could not run the
/// fresh copy, and said nothing.
fn copy_for_all(program: &Path) -> Result<(), String> {
    // By another process: one that any thread of this one starts meanwhile would have the copy
    // open for writing for a moment, and what is open for writing cannot be started.
    let mut install = Command::new("install");
    install.args(["-m", "755"]);
    install.arg(std::env::current_exe().unwrap()).arg(program);
    assert!(install.status().unwrap().success());
    let listed = command_as(65534, program, "--list", Path::new("/"))
        .output()
        .unwrap();
    if listed.status.success() && !listed.stdout.is_empty() {
        return Ok(());
    }
    let stderr = String::from_utf8_lossy(&listed.stderr);
    Err(format!(
        "{}: as another user: {}: {stderr}",
        program.display(),
        listed.status
    ))
}

#[allow(dead_code, reason = "not every test needs one that stays")]
impl Other {
    /// Starts it and waits until it is ready.
    pub fn start(test: &str, run: &Path) -> Self {
        let mut command = command(&std::env::current_exe().unwrap(), test, run);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        while !line.contains("ready") {
            line.clear();
            assert!(output.read_line(&mut line).unwrap() > 0, "it ended early");
        }
        // The rest of its output is discarded.
        std::thread::spawn(move || output.read_to_end(&mut Vec::new()));
        Self { child }
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Ends it at once.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Ends it as a supervisor would.
    pub fn stop(mut self) {
        let pid = rustix::process::Pid::from_raw(self.pid() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        // If a test failed before it was ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A piece of shared memory of a domain.
pub fn segment(domain: &randt_stage::Domain, kind: &str) -> PathBuf {
    let all = randt_stage::leftovers(domain).into_iter();
    let mut all = all.map(|file| file.path);
    all.find(|path| path.extension().is_some_and(|it| it == kind))
        .unwrap()
}
