//! A stage that starts clears the remains of dead ones away. Here it is held at its polls at the
//! nodes, one after the other, while another stage is killed: whatever it has seen before, no slot
//! stays taken by nobody.
//!
//! A tracer stops it at the poll, so that it does not depend on chance which one it is.

use crate::support::pipeline::{signal, until};
use crate::support::stages::{RunFolder, Running, program};
use randt_stage::{Domain, Registry, orphaned_slots};
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

/// A process that is only traced stands for microseconds at a call; one that is stopped still
/// stands after that many polls.
const STANDS: u32 = 20;
const BETWEEN_POLLS: Duration = Duration::from_millis(4);
/// A start takes at least that many polls.
const POLLS: usize = 8;
const WAIT_MAX: Duration = Duration::from_secs(60);

/// Whether a process is in its loop, or about to enter it.
fn runs(domain: &Domain, pid: u32) -> bool {
    let all = Registry::all(domain);
    // What the register has of a stage's name is the dead one's until the new one has written its
    // own.
    all.iter()
        .any(|(entry, lives)| *lives && entry.pid == u64::from(pid) && entry.topics.len() > 1)
}

fn start(folder: &RunFolder, domain: &Domain, stage: &str) -> Running {
    let started = folder.start(stage, RunFolder::command(domain, stage));
    until(stage, || runs(domain, started.pid()));
    started
}

fn kill(mut stage: Running) {
    let pid = Pid::from_raw(stage.pid() as i32).unwrap();
    kill_process(pid, Signal::KILL).unwrap();
    stage.wait(WAIT_MAX);
}

/// Says where it is not.
fn has_tracer() -> bool {
    let found = Command::new("strace").arg("-V").output().is_ok();
    if !found {
        assert!(std::env::var_os("CI").is_none(), "strace has to be there");
        println!("strace is not there: nothing is held");
    }
    found
}

/// The process that is traced.
fn traced(tracer: &Running) -> Option<u32> {
    let children = format!("/proc/{0}/task/{0}/children", tracer.pid());
    let children = fs::read_to_string(children).unwrap_or_default();
    children.split_whitespace().next()?.parse().ok()
}

/// Whether it stands.
fn stands(tracer: &Running) -> bool {
    let stat = traced(tracer).map(|pid| fs::read_to_string(format!("/proc/{pid}/stat")));
    let stat = stat.and_then(Result::ok).unwrap_or_default();
    // The state follows the name in brackets: `t` is stopped by a tracer, `T` by a signal.
    let state = stat.rsplit(')').next().unwrap_or_default();
    state.trim_start().starts_with(['t', 'T'])
}

/// Lets it go on, whether it stands or not. It may end in this moment.
fn go_on(tracer: &Running) {
    if let Some(pid) = traced(tracer).and_then(|pid| Pid::from_raw(pid as i32)) {
        let _ = kill_process(pid, Signal::CONT);
    }
}

/// Starts the filter, held at one of its polls; gives whether it took that many.
fn start_held(folder: &RunFolder, domain: &Domain, poll: usize) -> (Running, bool) {
    let mut command = Command::new("strace");
    let calls = "trace=openat,open";
    let stop = format!("inject=openat,open:signal=SIGSTOP:when={poll}");
    command.args(["-qq", "-o", "/dev/null", "-e", calls, "-e", &stop, "-P"]);
    command.arg(domain.root().join("nodes"));
    command.arg(program("filter"));
    command
        .args(["--prefix", domain.prefix(), "--run"])
        .arg(domain.run());
    let mut tracer = folder.start("filter", command);
    let begin = Instant::now();
    let mut stood = 0;
    while stood < STANDS {
        if traced(&tracer).is_some_and(|pid| runs(domain, pid)) {
            return (tracer, false);
        }
        assert!(tracer.ended().is_none(), "{}", tracer.stderr());
        assert!(begin.elapsed() < WAIT_MAX, "{}", tracer.stderr());
        std::thread::sleep(BETWEEN_POLLS);
        stood = if stands(&tracer) { stood + 1 } else { 0 };
    }
    (tracer, true)
}

/// Holds a start at one poll; gives whether it took that many.
fn hold(poll: usize) -> bool {
    let folder = RunFolder::new();
    let domain = folder.domain("held");
    let mapper = start(&folder, &domain, "mapper");
    let odometry = start(&folder, &domain, "odometry");
    kill(start(&folder, &domain, "filter"));
    // What the filter has left is cleared away by the next one, and meanwhile odometry dies.
    let (mut filter, is_held) = start_held(&folder, &domain, poll);
    kill(odometry);
    until("filter", || {
        go_on(&filter);
        traced(&filter).is_some_and(|pid| runs(&domain, pid))
    });
    let mut odometry = start(&folder, &domain, "odometry");
    assert_eq!(
        orphaned_slots(&domain),
        BTreeMap::new(),
        "held at poll {poll}"
    );
    odometry.stop();
    // The tracer ends with what it traces.
    signal(traced(&filter).unwrap(), Signal::KILL);
    filter.wait(WAIT_MAX);
    drop(mapper);
    is_held
}

#[test]
fn a_stage_that_dies_while_another_one_clears_up_leaves_no_slot_taken() {
    if !has_tracer() {
        return;
    }
    let polls = (1..).take_while(|poll| hold(*poll)).count();
    println!("{polls} polls");
    assert!(polls >= POLLS, "{polls}");
}
