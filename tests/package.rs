//! The Debian package: what is in it, and a machine on which it is installed, upgraded in part and
//! whole, and purged.

mod contents;

use crate::support::boot::{Image, Machine};
use crate::support::package::{OTHER_LAYOUT, PROGRAMS, build, collect};
use crate::support::robot::{BOOTED_MAX, ROBOT, can_boot, emulate, equip, until, until_alive};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// This test's own program on the machine.
const OURS: &str = "/usr/bin/test-package";

/// No test: the odometry of a build whose states have another layout, as a machine runs it.
#[test]
fn odometry_of_another_layout() {
    if std::env::var_os(OTHER_LAYOUT).is_some() {
        crate::support::package::run_other_odometry();
    }
}

/// Units with a main process, by the process.
fn pids(machine: &Machine) -> Vec<(String, u32)> {
    let stages = PROGRAMS.lines().filter(|name| *name != "randt");
    stages
        .map(|name| {
            (
                name.to_owned(),
                machine.property(name, "MainPID").parse().unwrap(),
            )
        })
        .collect()
}

/// Whose process is another one now, or none.
fn changed(before: &[(String, u32)], after: &[(String, u32)]) -> Vec<String> {
    let pairs = before.iter().zip(after);
    pairs
        .filter(|(a, b)| a != b)
        .map(|(a, _)| a.0.clone())
        .collect()
}

/// Puts a program on a machine, as `install` does: in the old one's place at once.
fn install_program(machine: &Machine, from: &Path, name: &str) {
    let to = machine.path("/usr/bin");
    let new = to.join(".new");
    fs::copy(from, &new).unwrap();
    fs::rename(new, to.join(name)).unwrap();
}

#[test]
fn it_is_installed_upgraded_and_purged() {
    if !can_boot() {
        return;
    }
    let begin = Instant::now();
    let folder = tempfile::tempdir().unwrap();
    let old = collect(folder.path(), "old", &[]);
    let other = ["randt-filter", "randt-mapper", "randt-recorder"];
    let new = collect(folder.path(), "new", &other);
    let image = Image::bare();
    equip(&image, folder.path(), 900);
    image.program(&std::env::current_exe().unwrap(), "test-package");
    fs::create_dir_all(image.file("opt")).unwrap();
    for (programs, version) in [(&old, "0.1.0"), (&new, "0.1.1")] {
        let package = build(programs, version, &folder.path().join(version));
        fs::copy(package, image.file(&format!("opt/{version}.deb"))).unwrap();
    }
    let machine = image.boot();
    println!("{:.1} s: booted", begin.elapsed().as_secs_f64());

    let output = machine.good(&["dpkg", "--install", "/opt/0.1.0.deb"]);
    assert!(output.contains("systemctl start randt.target"), "{output}");
    let is = |unit: &str, what: &str| {
        machine
            .run(&["systemctl", what, unit])
            .stdout
            .trim()
            .to_owned()
    };
    assert_eq!(is("randt.target", "is-enabled"), "enabled");
    assert_eq!(
        is("randt.target", "is-active"),
        "inactive",
        "nobody has set addresses yet"
    );
    assert!(pids(&machine).iter().all(|(_, pid)| *pid == 0));
    let user = machine.good(&["getent", "passwd", "randt"]);
    assert!(user.trim_end().ends_with("/nologin"), "{user}");
    let robot = machine.path("/etc/randt/robot.toml");
    fs::write(&robot, ROBOT).unwrap();
    machine.good(&["systemctl", "start", "randt.target"]);
    emulate(&machine);
    until_alive(&machine);
    until("all stages", BOOTED_MAX, || {
        pids(&machine)
            .iter()
            .all(|(name, pid)| *pid != 0 && is(name, "is-active") == "active")
    });
    println!("{:.1} s: alive", begin.elapsed().as_secs_f64());

    // A newer one, while a stage is stopped: what runs and is another program is restarted.
    machine.good(&["systemctl", "stop", "randt-recorder"]);
    machine.good(&["systemctl", "disable", "randt-view"]);
    let before = pids(&machine);
    let output = machine.good(&["dpkg", "--install", "/opt/0.1.1.deb"]);
    assert!(
        output.contains("restarted: randt-filter.service randt-mapper.service"),
        "{output}"
    );
    let after = pids(&machine);
    assert_eq!(changed(&before, &after), ["randt-filter", "randt-mapper"]);
    assert_eq!(is("randt-recorder", "is-active"), "inactive");
    assert_eq!(
        is("randt-view", "is-enabled"),
        "disabled",
        "the administrator's word"
    );
    assert_eq!(
        fs::read_to_string(&robot).unwrap(),
        ROBOT,
        "the administrator's file"
    );
    machine.good(&["systemctl", "start", "randt-recorder"]);
    until_alive(&machine);
    println!("{:.1} s: upgraded", begin.elapsed().as_secs_f64());

    // Odometry alone, while it drives.
    let newer = collect(folder.path(), "newer", &["randt-odometry"]);
    let before = pids(&machine);
    install_program(&machine, &newer.join("randt-odometry"), "randt-odometry");
    let restart = Instant::now();
    machine.good(&["systemctl", "restart", "randt-odometry"]);
    println!(
        "new odometry: back after {:.0} ms",
        restart.elapsed().as_secs_f64() * 1e3
    );
    until_alive(&machine);
    assert_eq!(changed(&before, &pids(&machine)), ["randt-odometry"]);

    // The same of a build whose messages are others: it is refused with what to do.
    let before = pids(&machine);
    let script = folder.path().join("script");
    let mut text = fs::File::create(&script).unwrap();
    let test = "--exact package::odometry_of_another_layout --nocapture";
    writeln!(text, "#!/bin/sh\n{OTHER_LAYOUT}=1 exec {OURS} {test}").unwrap();
    drop(text);
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    fs::set_permissions(&script, mode).unwrap();
    install_program(&machine, &script, "randt-odometry");
    let mut restart = machine.command(&["systemctl", "restart", "--no-block", "randt-odometry"]);
    assert!(restart.status().unwrap().success());
    let mut journal = String::new();
    until("a refusal", BOOTED_MAX, || {
        journal = machine.journal("randt-odometry", &["--priority", "err", "--output", "cat"]);
        journal.contains("was built") || journal.contains("were built")
    });
    let refusal = journal
        .lines()
        .rev()
        .find(|line| line.contains("odometry/state"))
        .unwrap();
    println!("{refusal}");
    for words in [
        "has the layout",
        "randt-recorder (process",
        "put the build back",
    ] {
        assert!(refusal.contains(words), "{words}: {refusal}");
    }
    assert_eq!(
        changed(&before, &pids(&machine)),
        ["randt-odometry"],
        "the others run"
    );
    install_program(&machine, &newer.join("randt-odometry"), "randt-odometry");
    until_alive(&machine);
    assert_eq!(changed(&before, &pids(&machine)), ["randt-odometry"]);
    println!(
        "{:.1} s: odometry replaced and refused",
        begin.elapsed().as_secs_f64()
    );

    // Removed: nothing runs, what was recorded and configured stays. Purged: the missions stay,
    // and what is not ours.
    machine.good(&["systemctl", "stop", "emulate-radar", "emulate-imu"]);
    machine.good(&["dpkg", "--remove", "randt"]);
    assert_eq!(
        machine.run(&["ps", "-u", "randt", "-o", "comm="]).stdout,
        ""
    );
    assert!(robot.exists() && machine.path("/var/lib/randt/current").exists());
    // Another user's pipeline, and links that the stages' user has left.
    let plant =
        "mkdir /dev/shm/randt-1000 /root/victim && touch /dev/shm/randt-1000/keep /root/victim/keep
        for at in /run/randt/link /dev/shm/randt-link /var/lib/randt/link; do
            ln -s /root/victim $at && chown -h randt:randt $at
        done";
    machine.good(&["sh", "-c", plant]);
    let missions = machine.good(&["find", "/var/lib/randt/missions"]);
    let output = machine.good(&["dpkg", "--purge", "randt"]);
    assert!(
        output.contains("the missions stay in /var/lib/randt"),
        "{output}"
    );
    assert_eq!(machine.good(&["find", "/var/lib/randt/missions"]), missions);
    assert!(missions.contains("map.journal"), "{missions}");
    assert_eq!(
        machine.good(&["find", "/root/victim", "-type", "f"]),
        "/root/victim/keep\n"
    );
    let places = ["/etc", "/usr", "/var/lib", "/run", "/dev/shm"];
    let mut find = vec!["find"];
    find.extend(places);
    find.extend(["-xdev", "-name", "*randt*"]);
    let left = machine.run(&find).stdout;
    assert_eq!(left, "/var/lib/randt\n/dev/shm/randt-1000\n");
    println!("{:.1} s: purged", begin.elapsed().as_secs_f64());
}

/// Rules name our devices, by their products where a maker has others, and FTDI's by those that
/// are Xsens'.
#[test]
fn rules_touch_our_devices_only() {
    let rules = include_str!("../systemd/udev/60-randt.rules");
    let rules: Vec<&str> = rules
        .lines()
        .filter(|line| !line.starts_with('#'))
        .collect();
    // Makers of nothing but sensors, or whose hubs have sensors behind them.
    let makers = ["06c2", "2639"];
    assert_eq!(rules.len(), 4, "{rules:?}");
    for rule in rules {
        let value = |key: &str| {
            let (_, rest) = rule.split_once(&format!("{{{key}}}==\""))?;
            rest.split('"').next()
        };
        let vendor = value("idVendor").unwrap();
        let product = value("idProduct");
        assert!(product.is_some() || makers.contains(&vendor), "{rule}");
        match vendor {
            // Of thousands of products with FTDI's number, the kernel knows these as Xsens'.
            "0403" => assert_eq!(product, Some("d38[89a-f]")),
            "199b" => assert_eq!(product, Some("3065")),
            _ => assert!(makers.contains(&vendor), "{rule}"),
        }
        assert!(rule.ends_with("GROUP=\"randt\", MODE=\"0660\""), "{rule}");
    }
}

/// On an older system, as it comes: `RANDT_TEST_ROOT=DIR RANDT_TEST_PACKAGE=FILE.deb cargo test
/// --test programs package:: -- --ignored`. The root, for example: `mmdebstrap --variant=minbase
/// --include=systemd,procps bullseye DIR`. The package: `systemd/package/build`.
#[test]
#[ignore = "needs the root of another system, and a package built for it, which takes minutes"]
fn it_runs_on_an_older_system() {
    let [root, package] = ["RANDT_TEST_ROOT", "RANDT_TEST_PACKAGE"]
        .map(|name| PathBuf::from(std::env::var_os(name).expect(name)));
    let folder = tempfile::tempdir().unwrap();
    let image = Image::bare();
    image.set_root(&root);
    equip(&image, folder.path(), 900);
    image.write("opt/robot.toml", ROBOT);
    fs::copy(package, image.file("opt/randt.deb")).unwrap();
    let machine = image.boot();
    println!(
        "{}",
        machine
            .good(&["systemctl", "--version"])
            .lines()
            .next()
            .unwrap()
    );
    machine.good(&["dpkg", "--install", "/opt/randt.deb"]);
    println!("{}", machine.good(&["randt", "--version"]).trim_end());
    let demo = machine.good(&["sh", "-c", "cd /tmp && randt demo"]);
    println!("{}", demo.lines().last().unwrap());
    let units = "cd /usr/lib/systemd/system && systemd-analyze verify randt* 2>&1 | grep randt";
    let verified = machine.run(&["sh", "-c", units]);
    // systemd itself may complain of the namespaces.
    assert_eq!(verified.stdout, "");
    machine.good(&["cp", "/opt/robot.toml", "/etc/randt/robot.toml"]);
    machine.good(&["systemctl", "start", "randt.target"]);
    emulate(&machine);
    until_alive(&machine);
    for (stage, pid) in pids(&machine) {
        println!("{stage}: {}", machine.status(&stage));
        assert_ne!(pid, 0, "{stage}");
    }
    machine.good(&["dpkg", "--purge", "randt"]);
    let find = [
        "find", "/etc", "/usr", "/var/lib", "/run", "/dev/shm", "-name", "*randt*",
    ];
    assert_eq!(
        machine
            .good(&find)
            .replace("/etc/systemd/system/test.target\n", ""),
        ""
    );
}

/// The programs that run on a machine without the package are the package's, but for the research
/// bench: a robot has no use for it.
#[test]
fn every_stage_is_packaged_and_has_a_unit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let line = manifest
        .lines()
        .find(|line| line.starts_with("default-members"))
        .unwrap();
    let members: Vec<&str> = line.split('"').skip(1).step_by(2).collect();
    let packaged = members.iter().filter(|member| **member != "tools/lab");
    assert_eq!(PROGRAMS.lines().count(), packaged.count(), "{line}");
    assert_eq!(PROGRAMS.lines().count() + 1, members.len(), "{line}");
    for program in PROGRAMS.lines().filter(|name| *name != "randt") {
        let unit: PathBuf = root.join(format!("systemd/{program}.service"));
        assert!(unit.is_file(), "{unit:?}");
    }
}
