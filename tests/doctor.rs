//! `randt doctor` on domains that are well, and on domains that are not.

mod rights;

use crate::support::pipeline::{Pipeline, log, signal};
use crate::support::stages::program;
use crate::support::{Ended, ended, names, randt};
use randt_messages::{ImuSample, RadarPoints, Topic};
use randt_stage::{Domain, Stage};
use rustix::process::Signal;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Whether a line of this grade holds these words.
fn has_line(ended: &Ended, grade: &str, words: &str) -> bool {
    let mut lines = ended.stdout.lines();
    lines.any(|line| line.starts_with(grade) && line.contains(words))
}

#[track_caller]
fn assert_line(ended: &Ended, grade: &str, words: &str) {
    assert!(
        has_line(ended, grade, words),
        "{grade} {words}\n{}{}",
        ended.stdout,
        ended.stderr
    );
}

/// It names the problem and the command that fixes it, and fails.
#[track_caller]
fn assert_bad(ended: &Ended, words: &str, fix: &str) {
    assert_line(ended, "BAD", words);
    assert_line(ended, "      fix it:", fix);
    assert_eq!(ended.code, Some(1));
}

/// A process that is alone with its mounts: the options of `unshare` that this user may use, where
/// there are any.
fn namespace() -> Option<&'static str> {
    let may = |options: &&str| {
        let mut command = Command::new("unshare");
        command.args([options, "mount", "-t", "tmpfs", "tmpfs", "/dev/shm"]);
        let silent = command.stdout(Stdio::null()).stderr(Stdio::null());
        silent.status().is_ok_and(|status| status.success())
    };
    let found = ["-m", "-rm"].iter().find(|options| may(options));
    if found.is_none() {
        assert!(std::env::var_os("CI").is_none(), "CI may make namespaces");
        println!("not run: no mount namespace for this user");
    }
    found.copied()
}

/// A program with a /dev/shm of its own.
fn alone(options: &str, size: &str, program: &Path) -> Command {
    let mut command = Command::new("unshare");
    let script = format!("mount -t tmpfs -o size={size} tmpfs /dev/shm && exec \"$0\" \"$@\"");
    command.args([options, "sh", "-c", &script]).arg(program);
    command
}

#[test]
fn a_good_domain_is_called_good() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    let mut pipeline = Pipeline::new("good");
    let nobody = pipeline.randt(&["doctor"]);
    assert_eq!(nobody.code, Some(0), "{}", nobody.stdout);
    assert_line(&nobody, "ok", "not there, no stage ever ran here");
    assert!(!pipeline.domain().folder().exists(), "it makes nothing");

    pipeline.stage("filter");
    pipeline.play(&log, &["--loop"]);
    let good = pipeline.randt(&["doctor"]);
    assert_eq!(good.code, Some(0), "{}", good.stdout);
    for about in [
        "user",
        "rights",
        "exposed",
        "memory",
        "run folder",
        "clock",
        "stages",
        "builds",
        "leftovers",
    ] {
        assert_line(&good, "ok", about);
    }
    assert_line(&good, "ok", "filter, play live");
}

#[test]
fn what_a_kill_leaves_is_found_and_cleaned_away() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    let mut pipeline = Pipeline::new("left");
    let filter = pipeline.stage("filter");
    pipeline.stage("odometry");
    pipeline.play(&log, &["--loop"]);
    let state = pipeline.domain().state();
    assert!(!names(&state).is_empty(), "odometry has checkpoints");

    // One dies, the others live.
    pipeline.end(filter, Signal::KILL);
    let died = pipeline.randt(&["doctor"]);
    assert_bad(
        &died,
        &format!("randt-filter has died as process {filter}"),
        "randt-filter --prefix left-",
    );
    assert_line(&died, "WARN", "that no living process has open");
    assert_line(&died, "WARN", "held by nobody living");
    let refused = pipeline.randt(&["doctor", "--clean", "--state"]);
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.stderr_contains("nothing was removed")
            && refused.stderr_contains("randt-odometry (process"),
        "{}",
        refused.stderr
    );
    assert!(
        refused.stderr_contains("randt play (process"),
        "{}",
        refused.stderr
    );
    let cleaned = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(cleaned.code, Some(0), "{}", cleaned.stderr);
    assert!(
        cleaned.stdout.contains("1 dead node and"),
        "{}",
        cleaned.stdout
    );
    let clean = pipeline.randt(&["doctor"]);
    assert_line(&clean, "ok", "every slot of a service is held");
    assert_line(&clean, "ok", "nothing is left of dead stages");

    // All die.
    pipeline.kill_all();
    let dead = pipeline.randt(&["doctor"]);
    assert_line(&dead, "WARN", "B) of dead stages");
    assert_line(
        &dead,
        "      fix it:",
        "randt doctor --clean --prefix left-",
    );
    let cleaned = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(cleaned.code, Some(0), "{}", cleaned.stderr);
    assert!(
        cleaned
            .stdout
            .contains("checkpoints and keyframes are kept"),
        "{}",
        cleaned.stdout
    );
    assert_eq!(pipeline.segments(), Vec::<String>::new());
    assert_eq!(names(&pipeline.domain().root()), Vec::<String>::new());
    assert!(
        !names(&state).is_empty(),
        "what a restart goes on from is kept"
    );
    let well = pipeline.randt(&["doctor"]);
    assert_eq!(well.code, Some(0), "{}", well.stdout);
    assert_line(&well, "ok", "nothing is left of dead stages");

    let wiped = pipeline.randt(&["doctor", "--clean", "--state"]);
    assert_eq!(wiped.code, Some(0), "{}", wiped.stderr);
    assert!(names(&state).is_empty());
    assert_eq!(pipeline.randt(&["doctor", "--state"]).code, Some(2));
}

#[test]
fn a_stopped_stage_and_a_lost_anchor_are_found() {
    let mut pipeline = Pipeline::new("stopped");
    let filter = pipeline.stage("filter");
    signal(filter, Signal::STOP);
    fs::remove_file(pipeline.domain().run().join("clock-anchor")).unwrap();
    let found = pipeline.randt(&["doctor"]);
    assert_line(&found, "WARN", "randt-filter (process");
    assert_line(&found, "      fix it:", &format!("kill -CONT {filter}"));
    assert_bad(
        &found,
        "a stage that starts now has other stamps",
        "stop all stages",
    );
}

/// Points as another build has them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OtherPoints;

impl Topic for OtherPoints {
    const NAME: &'static str = RadarPoints::NAME;
    const TYPE_NAME: &'static str = "RadarPoints-0123456789abcdef";
    const MAX_ITEMS: usize = 0;
    type Head = ImuSample;
    type Item = ();
}

#[test]
fn a_stage_of_another_build_is_named() {
    let pipeline = Pipeline::new("builds");
    // This process is a stage of another build.
    let mut stage = Stage::open("odd", pipeline.domain()).unwrap();
    let _points = stage.publisher::<OtherPoints>().unwrap();
    stage.running().unwrap();
    let found = pipeline.randt(&["doctor"]);
    let process = format!("randt-odd (process {})", std::process::id());
    assert_bad(
        &found,
        &format!("{process} has the layout RadarPoints-0123456789abcdef of radar/points/v1"),
        "restart randt-odd from this build",
    );
    // What doctor announces is what happens.
    let mut filter = Command::new(program("filter"));
    pipeline.enter(&mut filter);
    let filter = ended(filter);
    assert!(
        filter.stderr_contains(&format!("but {process} has RadarPoints-0123456789abcdef")),
        "{}",
        filter.stderr
    );
    stage.close().unwrap();
}

#[test]
fn a_program_that_was_replaced_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("randt-filter");
    fs::copy(program("filter"), &copy).unwrap();
    let mut pipeline = Pipeline::new("replaced");
    let mut filter = Command::new(&copy);
    pipeline.enter(&mut filter);
    pipeline.start("filter", filter);
    fs::remove_file(&copy).unwrap();
    let found = pipeline.randt(&["doctor"]);
    assert_line(&found, "WARN", "was replaced on disk since it started");
    assert_line(&found, "      fix it:", "restart randt-filter");
    assert_eq!(found.code, Some(0), "{}", found.stdout);
}

#[test]
fn two_worlds_are_distinguished() {
    let mut here = Pipeline::new("here");
    here.stage("filter");
    // The same prefix in another run folder, and another prefix.
    let there = Pipeline::new("there");
    let prefix = here.domain().prefix().to_owned();
    let twin = Domain::new(&prefix, Some(there.domain().run())).unwrap();
    let elsewhere = Stage::open("elsewhere", &twin).unwrap();
    let found = here.randt(&["doctor"]);
    let folder = twin.folder();
    assert_bad(
        &found,
        &format!(
            "has the same prefix in another run folder, {}",
            folder.display()
        ),
        "start it with --prefix here-",
    );
    let refused = here.randt(&["doctor", "--clean", "--state"]);
    assert!(
        refused.stderr_contains("nothing was removed"),
        "{}",
        refused.stderr
    );

    let other = there.randt(&["doctor"]);
    assert_line(
        &other,
        "WARN",
        &format!("another domain is in {}", here.domain().folder().display()),
    );

    // Its folder is removed under it.
    fs::remove_dir_all(&folder).unwrap();
    let found = ended({
        let mut command = randt(&["doctor", "--prefix", &prefix, "--run"]);
        command.arg(there.domain().run());
        command
    });
    assert_line(&found, "BAD", "which was removed under it");
    drop(elsewhere);
}

#[test]
fn a_stage_with_a_shared_memory_of_its_own_is_found() {
    let Some(options) = namespace() else { return };
    let mut pipeline = Pipeline::below("apart", &std::env::temp_dir());
    let mut filter = alone(options, "64m", &program("filter"));
    pipeline.enter(&mut filter);
    pipeline.start("filter", filter);
    let found = pipeline.randt(&["doctor"]);
    assert_bad(
        &found,
        "has a /dev/shm of its own",
        "same container and mount namespace",
    );
}

#[test]
fn too_little_shared_memory_is_bad() {
    let Some(options) = namespace() else { return };
    let folder = tempfile::tempdir().unwrap();
    let doctor = |size: &str| {
        let mut command = alone(options, size, Path::new(env!("CARGO_BIN_EXE_randt")));
        command.args(["doctor", "--prefix", "little", "--run"]);
        ended({
            command.arg(folder.path());
            command
        })
    };
    let little = doctor("4m");
    assert_bad(
        &little,
        "of 4.2 MB in /dev/shm",
        "mount -o remount,size=64M /dev/shm",
    );
    assert_line(&doctor("64m"), "ok", "memory");
}
