//! Programs that fail, that are not there, and that somebody kills.

use super::*;
use randt_stage::Domain;

fn program(path: &str, arguments: &[&str]) -> Program {
    let run = std::env::temp_dir();
    let domain = Domain::new("child", Some(&run)).unwrap();
    let mut program = Program::new("test", path.into(), &domain);
    program.arguments = arguments.iter().map(Into::into).collect();
    program
}

fn until(child: &Child, holds: impl Fn(&Child) -> bool) {
    let begin = Instant::now();
    while !holds(child) {
        assert!(
            begin.elapsed() < Duration::from_secs(10),
            "{:?}",
            child.failures()
        );
        std::thread::sleep(POLL_PERIOD);
    }
}

#[test]
fn a_program_that_fails_again_and_again_is_tried_on() {
    let folder = tempfile::tempdir().unwrap();
    let there = folder.path().join("there");
    let script = format!(
        "[ -e {0} ] && exec sleep 60; echo broken >&2; exit 1",
        there.display()
    );
    let mut child = Child::start(program("/bin/sh", &["-c", &script]), ProgressBar::hidden());
    until(&child, |child| child.failures().0 > u64::from(FAILURES_MAX));
    assert_eq!(child.failing().as_deref(), Some("broken"));
    assert_eq!(child.failures().1, "randt-test: broken");
    // What it lacked comes back.
    std::fs::write(&there, "").unwrap();
    until(&child, |child| child.failing().is_none());
    assert!(
        child.failures().0 > u64::from(FAILURES_MAX),
        "what was, was"
    );
    child.stop();
    assert!(!child.was_killed());
}

#[test]
fn a_program_that_is_not_there_or_refuses_its_options_is_named() {
    let absent = Child::start(program("/nowhere/randt-x", &[]), ProgressBar::hidden());
    until(&absent, |child| child.failing().is_some());
    let why = absent.failing().unwrap();
    assert!(why.contains("/nowhere/randt-x"), "{why}");
    let refused = program("/bin/sh", &["-c", "echo no >&2; exit 78"]);
    let mut refused = Child::start(refused, ProgressBar::hidden());
    until(&refused, |child| child.failing().is_some());
    std::thread::sleep(5 * BACK_OFF);
    assert_eq!(refused.failures(), (1, "randt-test: no".to_owned()));
    refused.stop();
    let mut absent = absent;
    absent.stop();
}

#[test]
fn a_program_that_somebody_kills_has_not_failed() {
    let mut child = Child::start(program("/bin/sleep", &["60"]), ProgressBar::hidden());
    for _ in 0..2 * FAILURES_MAX {
        until(&child, |child| child.shared.pid.load(Ordering::SeqCst) != 0);
        let pid = child.shared.pid.load(Ordering::SeqCst) as i32;
        let pid = Pid::from_raw(pid).unwrap();
        kill_process(pid, Signal::KILL).unwrap();
        let raw = pid.as_raw_pid() as u32;
        until(&child, |child| {
            child.shared.pid.load(Ordering::SeqCst) != raw
        });
    }
    assert_eq!(child.failures().0, 0);
    child.stop();
}

#[test]
fn the_end_is_asked_for_until_it_is_heard() {
    let folder = tempfile::tempdir().unwrap();
    let ready = folder.path().join("ready");
    // It forgets the first time, as a stage may.
    let script = format!(
        "trap 'trap \"exit 0\" TERM' TERM; touch {}; while :; do sleep 0.05; done",
        ready.display()
    );
    let mut child = Child::start(program("/bin/sh", &["-c", &script]), ProgressBar::hidden());
    until(&child, |_| ready.exists());
    child.stop();
    assert!(!child.was_killed());
}
