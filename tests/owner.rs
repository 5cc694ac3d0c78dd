//! Commands of root's in folders of the stages' user, who plants links in them: nothing of root's
//! is read, written, removed or given away.

mod robot;

use crate::support::{ended, names, randt};
use robot::{Robot, copy, give, plant};
use std::fs::{self, Permissions};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The stages' user, who may be anybody's.
const USER: u32 = 65534;
/// What is root's alone.
const SECRET: &str = "what root alone may read";
/// After that many commands the result is inspected.
const ROUND: usize = 50;
/// How long a link stands where it was put: short beside a command, long beside a step of one.
const HELD: Duration = Duration::from_micros(30);
/// Tells this program that it is the attacker, and where.
const ATTACKS: &str = "RANDT_TEST_ATTACKS";

#[test]
fn what_root_begins_and_stops_is_the_stages_users_and_no_link_is_followed() {
    let Some(robot) = Robot::new() else { return };
    robot.begin("one");
    let json = robot.mission("one").join("mission.json");
    // What is written under another name first, and what the link is made by.
    plant(
        &robot.path("secret"),
        &robot.mission("one").join("mission.json.part"),
    );
    plant(&robot.path("victim"), &robot.root().join(".current.part"));
    let stop = robot.randt(&["stop"]);
    assert_eq!(stop.code, Some(0), "{}", stop.stderr);
    robot.check();
    assert!(fs::read_to_string(&json).unwrap().contains("stopped_ns"));
    for path in ["current", "missions", "missions/one", "missions/one/logs"] {
        let found = fs::symlink_metadata(robot.root().join(path)).unwrap();
        assert_eq!((found.uid(), found.gid()), (USER, USER), "{path}");
    }
    assert_eq!(fs::metadata(&json).unwrap().uid(), USER);

    // A folder of a mission that leads to root's, and a record that does.
    robot.begin("two");
    robot.check();
    fs::remove_dir_all(robot.mission("two").join("logs")).unwrap();
    plant(&robot.path("victim"), &robot.mission("two").join("logs"));
    plant(&robot.path("victim"), &robot.mission("two").join("report"));
    plant(&robot.path("victim"), &robot.mission("two").join("state"));
    let json = robot.mission("two").join("mission.json");
    fs::remove_file(&json).unwrap();
    plant(&robot.path("secret"), &json);
    let list = robot.randt(&["list"]);
    assert!(
        !list.stdout.contains(SECRET) && !list.stderr.contains(SECRET),
        "{list:?}"
    );
    robot.randt(&["stop"]);
    robot.check();
    // The current one is a folder of root's; so are all.
    fs::remove_file(robot.root().join("current")).unwrap();
    plant(&robot.path("victim"), &robot.root().join("current"));
    fs::write(robot.path("victim/mission.json"), "{}").unwrap();
    robot.randt(&["stop"]);
    assert_eq!(fs::read(robot.path("victim/mission.json")).unwrap(), b"{}");
    fs::remove_file(robot.path("victim/mission.json")).unwrap();
    fs::rename(robot.root().join("missions"), robot.root().join("before")).unwrap();
    plant(&robot.path("victim"), &robot.root().join("missions"));
    let new = robot.randt(&["new", "three"]);
    assert_eq!(new.code, Some(1), "{}", new.stdout);
    assert!(
        new.stderr_contains("with the rights of user 65534"),
        "{}",
        new.stderr
    );
    robot.check();
}

#[test]
fn an_export_has_plain_files_of_the_missions_owner_only() {
    let Some(robot) = Robot::new() else { return };
    robot.begin("one");
    let mission = robot.mission("one");
    fs::write(mission.join("note.txt"), "of the drive").unwrap();
    give(&mission.join("note.txt"));
    plant(&robot.path("secret"), &mission.join("link.txt"));
    plant(&robot.path("victim"), &mission.join("folder"));
    fs::hard_link(robot.path("secret"), mission.join("hard.txt")).unwrap();
    let stick = robot.path("stick");
    let export = robot.randt(&["export", "one", "--out", stick.to_str().unwrap()]);
    assert_eq!(export.code, Some(3), "{}", export.stderr);
    for (name, why) in [
        ("link.txt", "is a link"),
        ("folder", "is a link"),
        ("hard.txt", "the mission's owner may not read it"),
    ] {
        assert!(
            export.stderr_contains(&format!("{name}: {why}; it is left out")),
            "{}",
            export.stderr
        );
    }
    assert_eq!(
        names(&stick.join("one")),
        ["logs", "mission.json", "note.txt"]
    );
    assert_eq!(names(&stick.join("one/logs")), Vec::<String>::new());
    for file in ["mission.json", "note.txt"] {
        assert_eq!(fs::metadata(stick.join("one").join(file)).unwrap().uid(), 0);
    }
    robot.check();

    // A pipe is not waited for.
    robot.begin("two");
    let mission = robot.mission("two");
    let fifo = rustix::fs::Mode::from_raw_mode(0o666);
    for name in ["pipe", "logs/2026-11-29T10-00-00Z.mcap.cut"] {
        let path = mission.join(name);
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, fifo, 0).unwrap();
        give(&path);
    }
    let export = robot.randt(&["export", "two", "--out", stick.to_str().unwrap()]);
    assert_eq!(export.code, Some(3), "{}", export.stderr);
    for name in ["pipe", "2026-11-29T10-00-00Z.mcap.cut"] {
        let words = format!("{name}: is no plain file; it is left out");
        assert!(export.stderr_contains(&words), "{}", export.stderr);
    }

    // Into a folder of another user's root writes with that user's rights.
    let theirs = robot.path("theirs");
    fs::create_dir(&theirs).unwrap();
    give(&theirs);
    plant(&robot.path("victim"), &theirs.join("one.part"));
    let export = robot.randt(&["export", "one", "--out", theirs.to_str().unwrap()]);
    assert_eq!(export.code, Some(3), "{}", export.stderr);
    assert_eq!(
        fs::metadata(theirs.join("one/note.txt")).unwrap().uid(),
        USER
    );
    plant(&robot.path("victim"), &robot.path("links"));
    let out = robot.path("links/out");
    let export = robot.randt(&["export", "one", "--out", out.to_str().unwrap()]);
    assert_eq!(export.code, Some(1), "{}", export.stdout);
    robot.check();
}

#[test]
fn roots_doctor_cleans_with_the_rights_of_the_domains_owner() {
    let Some(robot) = Robot::new() else { return };
    let run = robot.path("run");
    let doctor = |more: &[&str]| {
        let mut command = randt(&["doctor", "--prefix", "theirs", "--run"]);
        command.arg(&run).args(more);
        ended(command)
    };
    // The domain is a link to a folder of root's that has what a domain has.
    plant(&robot.path("victim"), &run.join("theirs"));
    for more in [&["--clean"] as &[&str], &["--clean", "--state"], &[]] {
        let output = doctor(more);
        assert_eq!(output.code, Some(1), "{}", output.stdout);
        robot.check();
    }
    fs::remove_file(run.join("theirs")).unwrap();
    // What is in a domain leads there.
    let domain = run.join("theirs");
    fs::create_dir(&domain).unwrap();
    fs::set_permissions(&domain, Permissions::from_mode(0o700)).unwrap();
    give(&domain);
    for name in ["bus", "state", "stages"] {
        plant(&robot.path("victim"), &domain.join(name));
    }
    doctor(&["--clean", "--state"]);
    robot.check();
    for name in ["bus", "state", "stages"] {
        fs::remove_file(domain.join(name)).unwrap();
    }
    // One that is well is cleaned.
    let clean = doctor(&["--clean", "--state"]);
    assert_eq!(clean.code, Some(0), "{}", clean.stderr);
    let found = fs::metadata(domain.join("bus")).unwrap();
    assert_eq!(found.uid(), USER, "what is made is the owner's");
}

/// No test: the stages' user, who swaps links in its folders until it is killed.
#[test]
fn attacks() {
    let Some(folder) = std::env::var_os(ATTACKS).map(PathBuf::from) else {
        return;
    };
    let (root, secret, victim) = (
        folder.join("missions"),
        folder.join("secret"),
        folder.join("victim"),
    );
    let mut swaps = 0_usize;
    println!("begins");
    loop {
        // What is written, and what is walked through: of the mission that is the current one at
        // this moment.
        let current = root.join(fs::read_link(root.join("current")).unwrap_or_default());
        let targets = [
            (current.join("mission.json.part"), &secret),
            (current.join("logs"), &victim),
            (current.join("note.txt"), &secret),
            (current.join("mission.json.part"), &secret),
            (current.join("report"), &victim),
            (current.join("mission.json"), &secret),
            (current.clone(), &victim),
            (root.join(".current.part"), &victim),
            (root.join("current"), &victim),
        ];
        for (target, to) in targets {
            swaps += 1;
            let moved = root.join(format!(".moved-{}", swaps % 7));
            // Best effort, all of it: the command works on the same files.
            let _ = fs::rename(&target, &moved);
            let _ = symlink(to, &target);
            std::thread::sleep(HELD);
            let _ = fs::remove_file(&target);
            let _ = fs::rename(&moved, &target);
            let _ = fs::remove_dir_all(&moved);
        }
    }
}

/// A process that is killed with this.
struct Attacker(Child);

impl Attacker {
    /// Waits until it has begun.
    fn begin(robot: &Robot, program: &Path) -> Self {
        let mut command = Command::new("setpriv");
        let id = USER.to_string();
        command.args(["--reuid", &id, "--regid", &id, "--clear-groups"]);
        command.arg(program);
        command.args(["--exact", "owner::attacks", "--nocapture"]);
        command.env(ATTACKS, robot.folder.path());
        command.stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        while !line.contains("begins") {
            line.clear();
            assert!(output.read_line(&mut line).unwrap() > 0, "it ended early");
        }
        Self(child)
    }
}

impl Drop for Attacker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Root's mission commands while somebody swaps links under them.
fn race(tries: usize) {
    let Some(robot) = Robot::new() else { return };
    // A copy that anybody may run, wherever this program lies.
    let program = robot.path("program");
    copy(&std::env::current_exe().unwrap(), &program);
    let stick = robot.path("stick");
    let (mut done, mut failed) = (0, 0);
    for begin in (0..tries).step_by(ROUND) {
        let attacker = Attacker::begin(&robot, &program);
        for number in begin..tries.min(begin + ROUND) {
            let name = format!("m{number}");
            let ended = match number % 4 {
                0 => robot.randt(&["new", &name]),
                1 => robot.randt(&["export", "--out", stick.to_str().unwrap()]),
                2 => robot.randt(&["stop"]),
                _ => robot.randt(&["list"]),
            };
            assert!(ended.code.is_some(), "{}", ended.stderr);
            if ended.code == Some(1) {
                failed += 1;
            } else {
                done += 1;
            }
        }
        // What is looked at must not be swapped meanwhile.
        drop(attacker);
        robot.check();
        // A few missions are as good as many, and quicker.
        for folder in ["missions/missions", "stick"] {
            for name in names(&robot.path(folder)) {
                let _ = fs::remove_dir_all(robot.path(folder).join(name));
            }
        }
    }
    println!("{tries} tries: {done} commands did their work, {failed} were kept from it");
    assert!(done > 0, "nothing was tried");
}

#[test]
fn a_race_against_roots_commands_gains_nothing() {
    race(200);
}

/// `cargo test --test programs owner:: -- --ignored`
#[test]
#[ignore = "10,000 commands take minutes: cargo test --test programs owner:: -- --ignored"]
fn ten_thousand_races_against_roots_commands_gain_nothing() {
    race(10_000);
}
