//! The program where there is no ROS; with one: `tests/ros1.rs` of the workspace.

use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

#[test]
fn without_its_python_the_stage_says_so_and_goes_on() {
    let run = tempfile::tempdir_in("/dev/shm").unwrap();
    let prefix = format!("ros1-without-{}", std::process::id());
    let mut stage = Command::new(env!("CARGO_BIN_EXE_randt-ros1"));
    stage.args(["--python", "/no/python", "--prefix", &prefix, "--run"]);
    let mut stage = stage
        .arg(run.path())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(stage.stderr.take().unwrap()).lines();
    let named = lines.any(|line| line.unwrap().contains("/no/python: No such file"));
    assert!(named);
    assert!(stage.try_wait().unwrap().is_none());
    kill_process(Pid::from_raw(stage.id() as i32).unwrap(), Signal::TERM).unwrap();
    assert!(stage.wait().unwrap().success());
}
