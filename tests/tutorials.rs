//! The first hours of docs/tutorial-*.md as somebody follows them: every command as it stands, in
//! its order, in an empty folder.

use crate::support::package::program;
use crate::support::turns::RealTime;
use crate::support::{ended_within, pages, python};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Longest that a page may take. They wait for drives, and compute for a few seconds.
const TIME_MAX: Duration = Duration::from_secs(120);

/// What is another one than in a clone: fewer sweeps to simulate, an address that no other test
/// has, where `cargo test` puts the library, and pauses that are long enough beside other tests.
const OTHERS: [(&str, &str); 6] = [
    ("--scans 300", "--scans 60"),
    ("127.0.0.1:6320", "127.23.0.1:6320"),
    ("$RANDT/target/debug", "$PROGRAMS/deps"),
    (
        "sleep 3\n",
        "until randt top --once | grep -q '^odometry  *[0-9].*running'; do sleep 0.2; done\n",
    ),
    ("sleep 2\n", "sleep 4\n"),
    // It finds the pipelines of other tests by the same name wrong, in other run folders.
    ("randt doctor\n", "randt doctor || [ $? = 1 ]\n"),
];
/// The environment of Python's that other tests have already.
const VENV: &str = "python3 -m venv venv\n";

/// Runs a page; gives what it printed.
fn follow(page: &str, replace: &[(&str, String)]) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = root.canonicalize().unwrap();
    let text = fs::read_to_string(root.join("docs").join(page)).unwrap();
    let blocks = pages::blocks(&text).into_iter();
    let blocks = blocks.filter(|block| block.language == "sh");
    // As in a terminal: what is started behind takes Ctrl-C.
    let mut script =
        "set -em\ntrap 'kill $(jobs -p) 2>/dev/null || true' EXIT\nset -x\n".to_owned();
    script.extend(blocks.map(|block| block.text + "\n"));
    for (from, to) in OTHERS {
        script = script.replace(from, to);
    }
    for (from, to) in replace {
        assert!(script.contains(from), "{page}: {from}");
        script = script.replace(from, to);
    }
    let folder = tempfile::tempdir().unwrap();
    // A session of its own, as private as a user's.
    let run = tempfile::tempdir_in("/dev/shm").unwrap();
    fs::set_permissions(run.path(), fs::Permissions::from_mode(0o700)).unwrap();
    let programs = program("randt");
    let programs = programs.parent().unwrap();
    let path = std::env::var("PATH").unwrap();
    let mut shell = Command::new("bash");
    shell.args(["-c", &script]).current_dir(folder.path());
    shell.env("RANDT", &root).env("PROGRAMS", programs);
    shell.env("PATH", format!("{}:{path}", programs.display()));
    shell.env("XDG_RUNTIME_DIR", run.path());
    let ended = ended_within(shell, TIME_MAX);
    assert_eq!(
        ended.code,
        Some(0),
        "{page}: {}{}",
        ended.stdout,
        ended.stderr
    );
    ended.stdout
}

#[test]
fn the_researchers_hour() {
    let printed = follow("tutorial-researcher.md", &[]);
    let ate = printed.lines().find(|line| line.starts_with("ATE"));
    let ate_m: f64 = ate
        .and_then(|line| line.split_whitespace().nth(1))
        .unwrap()
        .parse()
        .unwrap();
    assert!(ate_m < 0.05, "{printed}");
}

#[test]
fn the_robot_owners_hour() {
    // Sensors that are kept from sending would be bad ones.
    let real_time = RealTime::begin();
    let printed = follow("tutorial-robot.md", &[]);
    drop(real_time);
    for words in [
        "ok    gravity    up is +z",
        "trust      good",
        "odometry/state/v1",
    ] {
        assert!(printed.contains(words), "{words}: {printed}");
    }
}

#[test]
fn the_programmers_hour() {
    let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/python-logs");
    // Without a network the page ends where Python begins.
    let has_python = python::program(Path::new("none")).is_some();
    let link = format!("ln -s {} venv\n", venv.display());
    let replace = (
        VENV,
        if has_python {
            link
        } else {
            "exit 0\n".to_owned()
        },
    );
    let printed = follow("tutorial-programmer.md", &[replace]);
    // Ten scans in each language, and the odometer.
    let poses = printed.lines().filter(|line| line.contains(",map,"));
    assert!(poses.count() > 5, "{printed}");
    if has_python {
        assert!(printed.contains("\nodometer  "), "{printed}");
        assert!(printed.trim_end().ends_with(" m"), "{printed}");
    }
}
