//! docs/operate.md as an operator follows it: every command in it is run, in its order, on a
//! machine with emulated sensors.

use crate::support::boot::Image;
use crate::support::package::{build, collect};
use crate::support::robot::{BOOTED_MAX, can_boot, emulate, equip, until, until_alive};
use std::fs;

/// What is another one than on a robot: sensors that are emulated, no question where nobody
/// answers.
const OTHERS: [(&str, &str); 5] = [
    ("source = \"navtech\" ", "source = \"beam-udp\" "),
    ("192.168.0.1:6317", "127.0.0.1:6320"),
    ("/dev/ttyACM0", "/run/randt/imu"),
    // The machine's disk is small.
    ("\n[imu]\n", "\n[record]\nfree_min_gb = 0.1\n\n[imu]\n"),
    (
        "apt-get install",
        "apt-get install -y --no-install-recommends",
    ),
];
/// Begins before the sensors are asked.
const SENSORS: &str = "randt doctor sensors";
/// The drive has to have begun where this is asked.
const DRIVES: &str = "systemctl status --no-pager 'randt-*'";

/// The blocks of commands.
fn blocks(text: &str) -> Vec<String> {
    let blocks = text.split("```sh\n").skip(1);
    blocks
        .map(|block| block.split("```").next().unwrap().to_owned())
        .collect()
}

/// Single commands: a line each, or up to the end of what it writes.
fn commands(block: &str) -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    let mut within = false;
    for line in block.lines() {
        match commands.last_mut().filter(|_| within) {
            Some(command) => *command += &format!("\n{line}"),
            None => commands.push(line.to_owned()),
        }
        within = if within {
            line != "END"
        } else {
            line.contains("<<'END'")
        };
    }
    commands
}

#[test]
fn every_command_of_the_operators_page_works() {
    if !can_boot() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let image = Image::bare();
    equip(&image, folder.path(), 900);
    let programs = collect(folder.path(), "programs", &[]);
    let newer = collect(folder.path(), "newer", &["randt-filter", "randt-odometry"]);
    fs::create_dir_all(image.file("root/new")).unwrap();
    for (programs, version) in [(&programs, "0.2.0"), (&newer, "0.2.1")] {
        let package = build(programs, version, &folder.path().join(version));
        fs::copy(
            package,
            image.file(&format!("root/randt_{version}_amd64.deb")),
        )
        .unwrap();
    }
    fs::copy(
        programs.join("randt-odometry"),
        image.file("root/new/randt-odometry"),
    )
    .unwrap();
    fs::create_dir_all(image.file("media/stick")).unwrap();
    let machine = image.boot();

    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = fs::read_to_string(root.join("docs/operate.md")).unwrap();
    let mut emulated = false;
    for block in blocks(&page) {
        for command in commands(&block) {
            if command.contains(SENSORS) && !emulated {
                emulate(&machine);
                emulated = true;
            }
            if command.contains(DRIVES) {
                until_alive(&machine);
            }
            if command.contains("mission stop") {
                // Something to report.
                until("keyframes", BOOTED_MAX, || {
                    let status = machine.status("randt-mapper");
                    let count = status
                        .split(", ")
                        .nth(1)
                        .and_then(|word| word.split(' ').next());
                    status.is_empty()
                        || count.is_some_and(|count| count.parse::<u32>().unwrap() >= 3)
                });
            }
            let mut it = format!("cd /root\n{command}");
            for (from, to) in OTHERS {
                it = it.replace(from, to);
            }
            let ended = machine.run(&["timeout", "100", "bash", "-c", &it]);
            println!("# {command}\n{}{}", ended.stdout, ended.stderr);
            // `dpkg --verify` ends with 0 or 2 where something differs, and status with 3 where a
            // unit is not active.
            let is_good = ended.code == Some(0) || command.starts_with("dpkg --verify");
            if !is_good {
                let journal = [
                    "journalctl",
                    "--no-pager",
                    "-n",
                    "60",
                    "-o",
                    "short-precise",
                ];
                println!("{}", machine.run(&journal).stdout);
            }
            assert!(is_good, "{command}: {:?} {}", ended.code, ended.stderr);
            let failures =
                machine.run(&["systemctl", "list-units", "--failed", "--plain", "randt-*"]);
            assert!(
                !failures.stdout.contains("randt-"),
                "{command}: {}",
                failures.stdout
            );
        }
    }
}
