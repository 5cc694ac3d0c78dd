//! A robot whose power is cut while it drives, under systemd: everybody is gone at once, and what
//! was not on the disk.

use crate::support::boot::{Image, Machine};
use crate::support::fault_injection::STAGES;
use crate::support::journal::heads;
use crate::support::robot::{BOOTED_MAX, ROBOT, can_boot, emulate, equip, until, until_alive};
use crate::support::sensors::unix_s;
use crate::support::{ended, names};
use randt_messages::KeyframeHead;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// What a cut may take of the map: this much of its end.
const LOST_MAX_NS: i64 = 1_500_000_000;
/// EXT4_IOC_SHUTDOWN without a last flush: what has not reached the disk never does.
const CUT: &str = "import fcntl, os, struct\n\
     fcntl.ioctl(os.open('/var/lib/randt', os.O_RDONLY), 0x8004587d, struct.pack('I', 2))";

/// A robot with its disk.
fn boot(disk: &Path) -> Machine {
    let folder = tempfile::tempdir().unwrap();
    let image = Image::new(&STAGES);
    equip(&image, folder.path(), 400);
    image.write("etc/randt/robot.toml", ROBOT);
    image.disk(disk);
    image.enable_all(&STAGES);
    let machine = image.boot();
    until("the target", BOOTED_MAX, || {
        machine.property("randt.target", "ActiveState") == "active"
    });
    emulate(&machine);
    until_alive(&machine);
    machine
}

/// Number, odometry frame and stamp of every keyframe in the mission's map.
fn keyframes(machine: &Machine) -> Vec<(u64, u64, i64)> {
    let path = machine.path("/var/lib/randt/current/map.journal");
    let of = |head: KeyframeHead| (head.id, head.odom_frame_id, head.header.stamp_ns);
    heads(&path).into_iter().map(of).collect()
}

#[test]
fn after_a_power_cut_the_mission_goes_on() {
    if !can_boot() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().join("disk");
    fs::File::create(&disk).unwrap().set_len(256 << 20).unwrap();
    let mut make = Command::new("mkfs.ext4");
    make.arg("-q").arg(&disk);
    assert_eq!(ended(make).code, Some(0));

    let machine = boot(&disk);
    until("a map", BOOTED_MAX, || keyframes(&machine).len() >= 20);
    let current = fs::read_link(machine.path("/var/lib/randt/current")).unwrap();
    let logs = names(&machine.path("/var/lib/randt/current/logs"));
    let before = keyframes(&machine);
    let output = machine.status("randt-mapper");
    println!("randt-mapper: {output}; journal: {}", before.len());
    let cut_ns = (unix_s() * 1e9) as i64;
    machine.good(&["python3", "-c", CUT]);
    drop(machine);

    let machine = boot(&disk);
    assert_eq!(
        fs::read_link(machine.path("/var/lib/randt/current")).unwrap(),
        current
    );
    let mission = machine.journal("randt-mission", &[]);
    assert!(mission.contains(": goes on"), "{mission}");
    let after = keyframes(&machine);
    let kept = after
        .iter()
        .zip(&before)
        .take_while(|(a, b)| a == b)
        .count();
    let lost = &before[kept..];
    println!("{} of {} keyframes lost", lost.len(), before.len());
    for (id, _, stamp_ns) in lost {
        let age_ns = cut_ns - stamp_ns;
        assert!(age_ns < LOST_MAX_NS, "keyframe {id} was {age_ns} ns old");
    }
    assert!(kept > 0);

    // It drives on, in a part that nobody has joined to the map yet.
    until("a new part", BOOTED_MAX, || {
        let all = keyframes(&machine);
        all.last().is_some_and(|last| last.1 > all[kept - 1].1)
    });
    let all = keyframes(&machine);
    let frame = all[kept - 1].1;
    // Some may have been mapped between the last look and the cut.
    let mut new = all[kept..].iter().skip_while(|(_, f, _)| *f == frame);
    assert!(new.all(|(_, f, _)| *f > frame), "{all:?}");
    let user = [
        "setpriv",
        "--reuid",
        "randt",
        "--regid",
        "randt",
        "--clear-groups",
    ];
    let mut top = user.to_vec();
    top.extend(["randt", "top", "--once", "--json"]);
    let top: Value = serde_json::from_str(&machine.good(&top)).unwrap();
    println!("{}", top["map"]);
    assert_eq!(top["map"]["components"], 2);

    // The log that was cut is whole.
    until("a whole log", BOOTED_MAX, || {
        machine.property("randt-recover", "SubState") == "exited"
    });
    for log in logs {
        let whole = format!(
            "/var/lib/randt/current/logs/{}",
            log.trim_end_matches(".active")
        );
        println!(
            "{}",
            machine.good(&["randt", "log", "check", &whole]).trim_end()
        );
    }
}
