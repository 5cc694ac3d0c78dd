//! Under systemd: the units' text, and a machine that boots with them while every stage suffers
//! what a robot's stages do.

use crate::support::boot::{Image, Machine, units_folder};
use crate::support::directives::DIRECTIVES;
use crate::support::fault_injection::{FaultInjector, InjectedFault, STAGES};
use crate::support::large;
use crate::support::robot::{BOOTED_MAX, ROBOT, can_boot, emulate, equip, until, until_alive};
use crate::support::watch::{WATCHES, Watch};
use crate::support::{Ended, ended};
use randt::date::Now;
use randt::mission::Record;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Where this test's own program is on the machine.
const WATCHER: &str = "/usr/bin/randt-test-watch";
/// A journal to begin with, where it is set, instead of one that is made up: a map of thousands of
/// keyframes takes minutes to be driven.
const JOURNAL: &str = "RANDT_TEST_JOURNAL";

fn words(command: &[&str]) -> Ended {
    let mut it = Command::new(command[0]);
    it.args(&command[1..]);
    ended(it)
}

/// Units of what is not in the package, with their text.
fn bridges() -> Vec<(String, String)> {
    let name = "randt-ros2.service";
    let text = fs::read_to_string(units_folder().join("bridges").join(name)).unwrap();
    vec![(name.to_owned(), text)]
}

/// The units, with their text.
fn units() -> Vec<(String, String)> {
    let mut units: Vec<_> = fs::read_dir(units_folder())
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| {
            entry
                .path()
                .extension()
                .is_some_and(|kind| kind == "service")
        })
        .map(|entry| {
            let text = fs::read_to_string(entry.path()).unwrap();
            (entry.file_name().into_string().unwrap(), text)
        })
        .collect();
    units.sort();
    let others = ["view", "mission", "recover"];
    assert_eq!(units.len(), STAGES.len() + others.len());
    units
}

#[test]
fn units_are_understood_and_let_out_little() {
    if !Path::new("/usr/bin/systemd-analyze").exists() {
        assert!(
            std::env::var("CI").as_deref() != Ok("true"),
            "needs systemd"
        );
        return println!("not tested: it needs systemd");
    }
    let folder = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    for name in ["randt.target", "randt.slice"] {
        let path = folder.path().join(name);
        fs::copy(units_folder().join(name), &path).unwrap();
        paths.push(path.display().to_string());
    }
    for (name, text) in units().into_iter().chain(bridges()) {
        let path = folder.path().join(&name);
        // A program that is there.
        let program = text.split("ExecStart=").nth(1).unwrap();
        let program = program.split(' ').next().unwrap();
        fs::write(&path, text.replace(&format!("={program} "), "=/bin/true ")).unwrap();
        let path = path.display().to_string();
        let analysed = words(&[
            "systemd-analyze",
            "security",
            "--offline=yes",
            "--threshold=20",
            &path,
        ]);
        let last = analysed
            .stdout
            .lines()
            .last()
            .unwrap_or_default()
            .to_owned();
        println!("{last}");
        assert_eq!(analysed.code, Some(0), "{last}");
        paths.push(path);
    }
    let mut command = vec!["systemd-analyze", "verify"];
    command.extend(paths.iter().map(String::as_str));
    let verified = words(&command);
    assert_eq!((verified.code, verified.stderr.as_str()), (Some(0), ""));
}

#[test]
fn units_need_no_newer_systemd_than_245_and_agree_in_what_they_share() {
    let known = |name: &str| DIRECTIVES.iter().any(|(_, names)| names.contains(&name));
    // What may differ from stage to stage.
    let own = [
        "Description",
        "After",
        "ExecStart",
        "ReadWritePaths",
        "PrivateDevices",
        "PrivateNetwork",
        "IPAddressDeny",
        "RestrictAddressFamilies",
        "DeviceAllow",
        "TimeoutStopSec",
        "TimeoutStartSec",
        // The recorder's exit code shows that messages are in no log.
        "SuccessExitStatus",
        // Stages that watch have less priority than stages that compute.
        "Nice",
        "WatchdogSec",
    ];
    let mut shared: Option<Vec<String>> = None;
    let mut oneshots = Vec::new();
    for (name, text) in units() {
        let lines = text
            .lines()
            .filter(|line| !line.is_empty() && !line.starts_with(['#', '[']));
        let lines: Vec<(&str, &str)> = lines.map(|line| line.split_once('=').unwrap()).collect();
        for (directive, value) in &lines {
            assert!(known(directive), "{name}: {directive} is not in the table");
            if *directive == "WatchdogSec" {
                assert_eq!(*value, "2", "{name}");
            }
            let stops_others = ["Requires", "BindsTo", "RuntimeDirectory"];
            assert!(
                !stops_others.contains(directive) && *value != "notify-reload",
                "{name}"
            );
        }
        let agree = lines
            .iter()
            .filter(|(directive, _)| !own.contains(directive));
        let agree: Vec<String> = agree
            .map(|(directive, value)| format!("{directive}={value}"))
            .collect();
        // What is no stage is kept in by the same walls.
        let walls = |lines: &[String]| -> Vec<String> {
            lines
                .iter()
                .skip_while(|line| !line.starts_with("User="))
                .cloned()
                .collect()
        };
        if text.contains("Type=oneshot") {
            oneshots.push((name, walls(&agree)));
        } else {
            assert_eq!(*shared.get_or_insert(agree.clone()), agree, "{name}");
        }
    }
    for (name, walls) in oneshots {
        assert!(
            !walls.is_empty() && shared.as_ref().unwrap().ends_with(&walls),
            "{name}"
        );
    }
    let target = fs::read_to_string(units_folder().join("randt.target")).unwrap();
    assert!(!target.contains("Wants="), "a stage could not be disabled");
}

/// No test: the program that [`Watch`] runs on a machine.
#[test]
fn watches() {
    if std::env::var_os(WATCHES).is_some() {
        crate::support::watch::print();
    }
}

/// A machine with everything on it, as it is when neither sensor is there yet.
fn boot(folder: &Path) -> Machine {
    let image = Image::new(&STAGES);
    image.program(&std::env::current_exe().unwrap(), "randt-test-watch");
    equip(&image, folder, 900);
    image.write("etc/randt/robot.toml", ROBOT);
    // A large map, as of a mission that was interrupted a moment ago; tmpfiles gives it to the
    // stages' user.
    let mission = "var/lib/randt/missions/first";
    // The machine has this one's kernel, and so its boot.
    let now = Now::read();
    let record = Record {
        begun_ns: now.date_ns,
        boot: Some(now.boot),
        ..Record::default()
    };
    let record = serde_json::to_string(&record).unwrap();
    image.write(&format!("{mission}/mission.json"), &record);
    let journal = image.file(&format!("{mission}/map.journal"));
    match std::env::var_os(JOURNAL) {
        Some(from) => drop(fs::copy(from, journal).unwrap()),
        None => {
            let env = format!("RANDT_PROFILE=mixed\nRANDT_OPTIONS=--set {}\n", large::SET);
            image.write("etc/randt/randt.env", &env);
            large::write(&image.file("etc/randt/robot.toml"), &journal);
        }
    }
    symlink("missions/first", image.file("var/lib/randt/current")).unwrap();
    image.write(
        "etc/tmpfiles.d/test.conf",
        "Z /var/lib/randt - randt randt -\n",
    );
    image.enable_all(&STAGES);
    image.boot()
}

#[test]
fn a_machine_boots_without_sensors_and_every_stage_suffers_alone() {
    if !can_boot() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let begin = Instant::now();
    let machine = boot(folder.path());
    println!(
        "booted {:.1} s after the test began",
        begin.elapsed().as_secs_f64()
    );

    // The radar is off and the IMU is not plugged in.
    let active = |unit: &str| machine.property(unit, "ActiveState") == "active";
    until("the target", BOOTED_MAX, || {
        active("randt.target") && STAGES.iter().all(|stage| active(&format!("randt-{stage}")))
    });
    until("what is missing", BOOTED_MAX, || {
        let missing = |stage: &str, one: &str| {
            let status = machine.status(&format!("randt-{stage}"));
            status.starts_with(&format!("no {one} yet; "))
        };
        missing("radar", "scan") && missing("imu", "IMU sample")
    });
    for stage in STAGES {
        println!("  {stage:9} {}", machine.status(&format!("randt-{stage}")));
    }
    let shown = machine
        .run(&["systemctl", "status", "--no-pager", "randt-imu"])
        .stdout;
    assert!(shown.contains("/run/randt/imu"), "{shown}");

    // Both appear.
    emulate(&machine);
    let alive = until_alive(&machine);
    println!("alive {:.1} s after the sensors", alive.as_secs_f64());
    for stage in STAGES {
        println!("  {stage:9} {}", machine.status(&format!("randt-{stage}")));
    }

    let watch = Watch::begin(&machine, WATCHER);
    let mut faults = FaultInjector::new(&machine, &watch);
    for stage in STAGES {
        for fault in [
            InjectedFault::Restart,
            InjectedFault::StopStart,
            InjectedFault::Kill,
            InjectedFault::Hang,
        ] {
            faults.strike(stage, fault);
        }
    }
    reload(&machine);
    wrong_configuration(&machine);
    ends(&machine);
    real_time(&machine);
    fields(&machine);
    println!("all of it took {:.0} s", begin.elapsed().as_secs_f64());
    faults.check();
}

/// SIGHUP: what can change live does, the rest is named, nobody is restarted.
fn reload(machine: &Machine) {
    let pids = crate::support::fault_injection::pids(machine);
    let robot = machine.path("/etc/randt/robot.toml");
    let changed = ROBOT.replace("[imu]\n", "silence_s = 2.0\n[imu]\nsilence_s = 1.5\n");
    fs::write(&robot, changed.replace("0.12", "0.25")).unwrap();
    for stage in STAGES {
        machine.good(&["systemctl", "reload", &format!("randt-{stage}")]);
    }
    let says = |stage: &str, words: &str| {
        let journal = machine.journal(&format!("randt-{stage}"), &[]);
        assert!(journal.contains(words), "randt-{stage}: {words}: {journal}");
    };
    for stage in STAGES {
        let unit = format!("randt-{stage}");
        until("reloaded", BOOTED_MAX, || {
            machine.property(&unit, "SubState") == "running"
        });
        says(stage, "the configuration was read again");
    }
    says(
        "radar",
        "radar.silence_s is 2.0 from now on, not 1.0 (/etc/randt/robot.toml:6)",
    );
    says("imu", "imu.silence_s is 1.5 from now on");
    says(
        "odometry",
        "robot.radar_x_m is 0.25 (/etc/randt/robot.toml:2), but 0.12 stays in force",
    );
    says("odometry", "systemctl restart randt-odometry");
    says("filter", "nothing of it has changed");
    assert_eq!(crate::support::fault_injection::pids(machine), pids);
    fs::write(&robot, ROBOT).unwrap();
}

/// A stage with a wrong configuration stays down and prints what would be right; the others go on.
fn wrong_configuration(machine: &Machine) {
    let robot = machine.path("/etc/randt/robot.toml");
    fs::write(&robot, ROBOT.replace("address =", "adress =")).unwrap();
    let pids = crate::support::fault_injection::pids(machine);
    // One that runs keeps what it has.
    machine.good(&["systemctl", "reload", "randt-filter"]);
    machine.run(&["systemctl", "restart", "randt-imu"]);
    let property = |name: &str| machine.property("randt-imu", name);
    until("the end", BOOTED_MAX, || {
        property("ActiveState") == "failed"
    });
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(
        (property("ActiveState"), property("ExecMainStatus")),
        ("failed".into(), "78".into())
    );
    let right =
        "/etc/randt/robot.toml:5: unknown key \"radar.adress\"; did you mean \"radar.address\"?";
    for unit in ["randt-imu", "randt-filter"] {
        let journal = machine.journal(unit, &["--priority", "err"]);
        assert!(journal.contains(right), "{unit}: {journal}");
    }
    let others = |pids: Vec<(String, u32)>| -> Vec<(String, u32)> {
        pids.into_iter()
            .filter(|(unit, _)| unit != "randt-imu.service")
            .collect()
    };
    assert_eq!(
        others(crate::support::fault_injection::pids(machine)),
        others(pids)
    );
    fs::write(&robot, ROBOT).unwrap();
    machine.good(&["systemctl", "start", "randt-imu"]);
}

/// Each stop takes effect, although systemd sends a SIGCONT right behind the SIGTERM.
fn ends(machine: &Machine) {
    for _ in 0..12 {
        let begin = Instant::now();
        machine.good(&["systemctl", "restart", "randt-recorder"]);
        assert!(
            begin.elapsed() < Duration::from_secs(5),
            "a stop was not heard"
        );
    }
}

/// The optional drop-in.
fn real_time(machine: &Machine) {
    let drop_in = fs::read_to_string(units_folder().join("realtime/50-realtime.conf")).unwrap();
    let folder = machine.path("/etc/systemd/system/randt-radar.service.d");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("50-realtime.conf"), drop_in).unwrap();
    machine.good(&["systemctl", "daemon-reload"]);
    machine.good(&["systemctl", "restart", "randt-radar"]);
    let pid = machine.property("randt-radar", "MainPID");
    assert_eq!(machine.good(&["ps", "-o", "cls=", "-p", &pid]).trim(), "FF");
}

/// What the journal knows of a line, and what the units look like where they are installed.
fn fields(machine: &Machine) {
    let journal = machine.journal("randt-odometry", &["--output=json", "--lines=200"]);
    let entries = journal
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let ours: Vec<_> = entries
        .filter(|entry| entry["RANDT_STAGE"] == "odometry")
        .collect();
    assert!(!ours.is_empty(), "{journal}");
    for name in ["RANDT_EPOCH", "PRIORITY", "SYSLOG_IDENTIFIER", "MESSAGE"] {
        assert!(ours.iter().all(|entry| entry[name].is_string()), "{name}");
    }
    assert!(ours.iter().any(|entry| entry["RANDT_SEQUENCE"].is_string()));
    let units: Vec<String> = STAGES
        .iter()
        .map(|stage| format!("randt-{stage}.service"))
        .collect();
    let mut verify = vec!["systemd-analyze", "verify", "randt.target", "randt.slice"];
    verify.extend(units.iter().map(String::as_str));
    let verified = machine.run(&verify);
    assert_eq!((verified.code, verified.stderr.as_str()), (Some(0), ""));
}
