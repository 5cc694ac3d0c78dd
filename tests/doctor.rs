//! `randt doctor` on domains that are well, and on domains that are not.

use crate::support::pipeline::{Pipeline, log, signal};
use crate::support::stages::program;
use crate::support::{Ended, ended, names, randt};
use randt_messages::{ImuSample, RadarPoints, Topic};
use randt_stage::{Domain, Stage};
use rustix::process::Signal;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// Whether a line of this grade holds these words.
fn says(ended: &Ended, grade: &str, words: &str) -> bool {
    let mut lines = ended.stdout.lines();
    lines.any(|line| line.starts_with(grade) && line.contains(words))
}

#[track_caller]
fn assert_says(ended: &Ended, grade: &str, words: &str) {
    assert!(
        says(ended, grade, words),
        "{grade} {words}\n{}{}",
        ended.stdout,
        ended.stderr
    );
}

/// It says so, tells what mends it, and fails.
#[track_caller]
fn assert_bad(ended: &Ended, words: &str, mend: &str) {
    assert_says(ended, "BAD", words);
    assert_says(ended, "      fix it:", mend);
    assert_eq!(ended.code, Some(1));
}

/// A process that is alone with its mounts: the options of `unshare` that this user may use, where there are any.
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
    assert_says(&nobody, "ok", "not there, no stage ever ran here");
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
        assert_says(&good, "ok", about);
    }
    assert_says(&good, "ok", "filter, play live");
}

#[test]
fn another_users_domain_is_told_with_whose_it_is() {
    if !rustix::process::geteuid().is_root() {
        // A folder that is surely there and not this user's.
        let other = ended(randt(&["doctor", "--run", "/", "--prefix", "usr"]));
        assert_bad(&other, "belongs to user 0", "sudo -u '#0' randt doctor");
        return;
    }
    // Root looks and cleans with the rights of whoever has it.
    let pipeline = Pipeline::new("whose");
    pipeline.domain().make().unwrap();
    let domain = pipeline.domain();
    for folder in [
        domain.run(),
        &domain.folder(),
        &domain.root(),
        &domain.state(),
    ] {
        std::os::unix::fs::chown(folder, Some(65534), None).unwrap();
    }
    let other = pipeline.randt(&["doctor"]);
    assert_eq!(other.code, Some(0), "{}{}", other.stdout, other.stderr);
    assert_says(&other, "ok", "this process are user 65534");
    let clean = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(clean.code, Some(0), "{}", clean.stderr);
}

#[test]
fn a_file_that_others_may_write_to_is_found_and_closed() {
    let mut pipeline = Pipeline::new("open");
    pipeline.stage("filter");
    let count = pipeline.segments().into_iter();
    let mut count = count.filter(|name| name.ends_with("global_mgmt"));
    let count = Path::new("/dev/shm").join(count.next().unwrap());
    let mode = || fs::metadata(&count).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(), 0o600, "whatever iceoryx2 makes of it");
    fs::set_permissions(&count, Permissions::from_mode(0o666)).unwrap();
    assert_bad(
        &pipeline.randt(&["doctor"]),
        "1 file that other users may read or write, such as /dev/shm/open-",
        "randt doctor --clean --prefix open-",
    );
    let clean = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(clean.code, Some(0), "{}", clean.stderr);
    assert_eq!(mode(), 0o600);
    assert_says(&pipeline.randt(&["doctor"]), "ok", "for their owner alone");
}

#[test]
fn the_run_folder_is_the_sessions_where_that_is_the_users_alone() {
    if Path::new("/run/randt").is_dir() {
        return println!("not run: this machine has /run/randt");
    }
    let session = tempfile::tempdir().unwrap();
    let title = |said: &str| {
        let mut doctor = randt(&["doctor", "--prefix", "session"]);
        doctor.env("XDG_RUNTIME_DIR", said);
        let said = ended(doctor).stdout;
        said.lines().next().unwrap().to_owned()
    };
    let path = session.path().to_str().unwrap();
    fs::set_permissions(path, Permissions::from_mode(0o700)).unwrap();
    assert_eq!(title(path), format!("domain session in {path}/randt"));
    let usual = title("");
    assert!(!usual.contains(path), "{usual}");
    // What others may look into is no session's, nor is what is not there, or no absolute path.
    fs::set_permissions(path, Permissions::from_mode(0o755)).unwrap();
    for other in [path, "/nowhere", "."] {
        assert_eq!(title(other), usual, "{other}");
    }
}

#[test]
fn a_domain_that_this_user_may_not_look_into_is_told_with_whose_it_is() {
    if !rustix::process::geteuid().is_root() {
        // Only root can become somebody else.
        assert!(std::env::var_os("CI").is_none(), "CI runs this as root");
        println!("not run: this user is not root");
        return;
    }
    let mut pipeline = Pipeline::new("hidden");
    pipeline.stage("filter");
    // A copy that anybody may run, wherever this program lies.
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
    let program = folder.path().join("randt");
    fs::copy(env!("CARGO_BIN_EXE_randt"), &program).unwrap();
    let as_nobody = |words: &[&str]| {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]);
        command.arg(&program).args(words);
        let domain = pipeline.domain();
        command.args(["--prefix", domain.prefix(), "--run"]);
        command.arg(domain.run());
        ended(command)
    };
    assert_bad(
        &as_nobody(&["doctor"]),
        "belongs to user 0, this process is user 65534",
        "sudo -u '#0' randt doctor",
    );
    let top = as_nobody(&["top", "--once"]);
    assert_eq!(top.code, Some(1));
    assert!(top.says("belongs to user 0"), "{}", top.stderr);
}

#[test]
fn rights_that_are_too_wide_are_bad() {
    let pipeline = Pipeline::new("rights");
    pipeline.domain().make().unwrap();
    let folder = pipeline.domain().folder();
    let mend = format!("chmod 700 {}", folder.display());
    fs::set_permissions(&folder, Permissions::from_mode(0o777)).unwrap();
    assert_bad(
        &pipeline.randt(&["doctor"]),
        "others may write in it",
        &mend,
    );
    fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
    let looks = pipeline.randt(&["doctor"]);
    assert_says(&looks, "WARN", "others may look into it");
    assert_eq!(looks.code, Some(0));
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
    assert_says(&died, "WARN", "that no living process has open");
    assert_says(&died, "WARN", "held by nobody living");
    let refused = pipeline.randt(&["doctor", "--clean", "--state"]);
    assert_eq!(refused.code, Some(1));
    assert!(
        refused.says("nothing was removed") && refused.says("randt-odometry (process"),
        "{}",
        refused.stderr
    );
    assert!(refused.says("randt play (process"), "{}", refused.stderr);
    let cleaned = pipeline.randt(&["doctor", "--clean"]);
    assert_eq!(cleaned.code, Some(0), "{}", cleaned.stderr);
    assert!(
        cleaned.stdout.contains("1 dead node and"),
        "{}",
        cleaned.stdout
    );
    let clean = pipeline.randt(&["doctor"]);
    assert_says(&clean, "ok", "every slot of a service is held");
    assert_says(&clean, "ok", "nothing is left of dead stages");

    // All die.
    pipeline.kill_all();
    let dead = pipeline.randt(&["doctor"]);
    assert_says(&dead, "WARN", "B) of dead stages");
    assert_says(
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
    assert_says(&well, "ok", "nothing is left of dead stages");

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
    assert_says(&found, "WARN", "randt-filter (process");
    assert_says(&found, "      fix it:", &format!("kill -CONT {filter}"));
    assert_bad(
        &found,
        "a stage that starts now has other stamps",
        "stop all stages",
    );
}

/// Points as another build has them.
#[derive(Debug)]
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
    // What doctor says is what happens.
    let mut filter = Command::new(program("filter"));
    pipeline.enter(&mut filter);
    let filter = ended(filter);
    assert!(
        filter.says(&format!("but {process} has RadarPoints-0123456789abcdef")),
        "{}",
        filter.stderr
    );
    stage.close().unwrap();
}

#[test]
fn a_program_that_was_replaced_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("randt-filter");
    fs::copy(program("filter"), &copy).unwrap();
    let mut pipeline = Pipeline::new("replaced");
    let mut filter = Command::new(&copy);
    pipeline.enter(&mut filter);
    pipeline.start("filter", filter);
    fs::remove_file(&copy).unwrap();
    let found = pipeline.randt(&["doctor"]);
    assert_says(&found, "WARN", "was replaced on disk since it started");
    assert_says(&found, "      fix it:", "restart randt-filter");
    assert_eq!(found.code, Some(0), "{}", found.stdout);
}

#[test]
fn two_worlds_are_told_apart() {
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
    assert!(refused.says("nothing was removed"), "{}", refused.stderr);

    let other = there.randt(&["doctor"]);
    assert_says(
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
    assert_says(&found, "BAD", "which was removed under it");
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
    assert_says(&doctor("64m"), "ok", "memory");
}
