//! A second process: this test program once more, running one of its tests as somebody else.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Tells the second process that it is it, and where the pipeline is.
const RUN: &str = "RANDT_TEST_RUN";

/// The second process, once it has said that it is ready.
pub struct Other {
    child: Child,
}

/// Where the pipeline is; `None` where this is the first process.
pub fn told() -> Option<PathBuf> {
    std::env::var_os(RUN).map(PathBuf::from)
}

/// The command that runs a test of `program`, a copy of this one, as the second process.
pub fn command(program: &Path, test: &str, run: &Path) -> Command {
    let mut command = Command::new(program);
    command.args([test, "--exact", "--nocapture"]);
    command.env(RUN, run);
    command
}

#[allow(dead_code, reason = "not every test needs one that stays")]
impl Other {
    /// Starts it and waits until it is ready.
    pub fn start(test: &str, run: &Path) -> Self {
        let mut command = command(&std::env::current_exe().unwrap(), test, run);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        while !line.contains("ready") {
            line.clear();
            assert!(said.read_line(&mut line).unwrap() > 0, "it ended early");
        }
        // Whatever else it says goes nowhere.
        std::thread::spawn(move || said.read_to_end(&mut Vec::new()));
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
        // Where a test failed before it was ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
