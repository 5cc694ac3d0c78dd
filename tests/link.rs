//! `randt-link` between two pipelines: a robot's topics on a base's bus, a mapper at the base, keys
//! that are refused, and a bad radio between two network namespaces.

mod at_base;
mod ends;
mod heard;
mod long;
mod over_radio;

use crate::support::pipeline::log;
use crate::support::stages::program;
use ends::{Base, Ends, Robot, keys};
use heard::{Heard, check_map, listen_until};
use over_radio::{OverRadio, listen_for};
use randt_messages::health::text_of;
use rustix::process::Signal;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

#[test]
fn a_robots_topics_are_on_the_bases_bus_whole_whichever_end_is_killed() {
    let mut ends = Ends::new("");
    let folder = ends.folder.path().to_owned();
    let input = log(&folder, 90);
    ends.robot.compute(&folder);
    ends.link(Robot);
    ends.link(Base);
    let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
    ends.robot.play(&input, &["--stay"]);
    for (end, keyframes) in [(Base, 4), (Robot, 8)] {
        listen_until("keyframes", &mut both, |both| {
            both[1].keyframe.len() >= keyframes
        });
        ends.kill_link(end);
        let there = both[0].keyframe.len();
        listen_until("keyframes meanwhile", &mut both, |both| {
            both[0].keyframe.len() >= there + 2
        });
        ends.link(end);
    }
    listen_until("the end of the drive", &mut both, |[robot, base]| {
        let ends = |heard: &Heard| heard.state.last_key_value().map(|(id, _)| *id);
        ends(robot) >= Some(89)
            && ends(base) == ends(robot)
            && base.keyframe.len() == robot.keyframe.len()
            && base.correction.map(|it| it.graph_version)
                == robot.correction.map(|it| it.graph_version)
            && base.tile == robot.tile
            && !base.tile.is_empty()
    });
    let [robot, base] = &both;
    assert_eq!(base.keyframe, robot.keyframe);
    let last = |heard: &Heard| heard.state.last_key_value().unwrap().1.pose;
    assert_eq!(last(base), last(robot));
    for stage in ["filter", "odometry", "mapper", "link", "link-base"] {
        assert!(base.stages.contains_key(stage), "{stage}");
    }
    let top = ends.base.randt(&["top", "--once", "--json"]);
    let top: serde_json::Value = serde_json::from_str(&top.stdout).unwrap();
    let stages = top["stages"].as_array().unwrap();
    let odometry = stages.iter().find(|stage| stage["name"] == "odometry");
    assert_eq!(odometry.unwrap()["state"], "running", "{stages:?}");
    // Each once but where an end was killed, and never backwards by more than that.
    let doubles = base.order.len() - base.keyframe.len();
    assert!(doubles <= 40, "{:?}", base.order);
}

#[test]
fn a_mapper_at_the_base_makes_the_robots_map_whatever_is_killed_meanwhile() {
    let mut ends = Ends::new("mapper = \"base\"");
    let folder = ends.folder.path().to_owned();
    let input = log(&folder, 110);
    ends.link(Robot);
    let [odometry, filter] = ["odometry", "filter"].map(|name| ends.robot.stage(name));
    ends.link(Base);
    let journal = folder.join("base.journal");
    let mut mapper = ends.base.mapper(&journal);
    let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
    ends.robot.play(&input, &["--stay"]);
    for step in 0..3 {
        let there = both[0].keyframe.len();
        listen_until("keyframes", &mut both, |both| {
            both[0].keyframe.len() >= there + 4
        });
        match step {
            0 => {
                ends.base.end(mapper, Signal::KILL);
                ends.kill_link(Base);
                ends.link(Base);
                mapper = ends.base.mapper(&journal);
            }
            1 => {
                ends.kill_link(Robot);
                ends.robot.end(odometry, Signal::KILL);
                ends.robot.stage("odometry");
                ends.link(Robot);
            }
            _ => {
                ends.robot.end(filter, Signal::KILL);
                ends.robot.stage("filter");
                ends.base.end(mapper, Signal::KILL);
                mapper = ends.base.mapper(&journal);
            }
        }
    }
    listen_until(
        "the whole map, and its correction on the robot",
        &mut both,
        |both| {
            let [robot, base] = both;
            let version = |heard: &Heard| heard.correction.map(|it| it.graph_version);
            let keyframes = robot.keyframe.len();
            robot
                .state
                .last_key_value()
                .is_some_and(|(id, _)| *id >= 109)
                && base.graph.is_some_and(|it| it.on_disk == keyframes as u64)
                && base.nodes.len() == keyframes
                && robot.graph.is_some_and(|it| it.on_disk == keyframes as u64)
                && version(robot) == version(base)
        },
    );
    let [robot, base] = &both;
    assert_eq!(base.keyframe, robot.keyframe);
    let place = |heard: &Heard| heard.correction.unwrap().map_from_odom;
    assert_eq!(place(robot), place(base));
    check_map(base, &folder.join("link.journal"));
}

#[test]
fn a_wrong_an_expired_and_a_refused_key_get_nothing_and_are_named() {
    let mut ends = Ends::new("");
    let folder = ends.folder.path().to_owned();
    let (right, other) = (folder.join("keys"), folder.join("other"));
    for name in ["base", "spot", "rover"] {
        keys(&right, name, "10");
    }
    keys(&other, "spot", "10");
    std::fs::rename(right.join("spot"), right.join("valid")).unwrap();
    keys(&right, "spot", "0");
    std::fs::rename(right.join("spot"), right.join("expired")).unwrap();
    let input = log(&folder, 30);
    ends.robot.compute(&folder);
    ends.robot.play(&input, &["--stay"]);
    let text = |ends: &Ends, end| std::fs::read_to_string(ends.configuration(end)).unwrap();
    let (robot, base) = (text(&ends, Robot), text(&ends, Base));
    let set = |ends: &Ends, end, text: &str, keys: &Path, more: &str| {
        let text = format!("{text}keys = {keys:?}\n{more}\n");
        std::fs::write(ends.configuration(end), text).unwrap();
    };
    for (key, more, words) in [
        (
            "other/spot",
            "",
            "the other end does not know this one's key",
        ),
        ("keys/expired", "", "its key has expired"),
        ("keys/rover", "", "refused: key of \"rover\", another one's"),
        (
            "keys/valid",
            "refused = \"spot\"",
            "refused: key of \"spot\", it is in link.refused",
        ),
        ("keys/valid", "", ""),
    ] {
        set(&ends, Robot, &robot, &folder.join(key), "");
        set(&ends, Base, &base, &right.join("base"), more);
        ends.link(Base);
        ends.link(Robot);
        let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
        listen_until(key, &mut both, |[_, base]| {
            let end = base.stages.get("link-base");
            let message = end.map_or("", |end| text_of(&end.message));
            match words {
                "" => !base.state.is_empty() && !base.keyframe.is_empty(),
                _ => message.contains(words),
            }
        });
        let heard = &both[1];
        if !words.is_empty() {
            let names: Vec<&String> = heard.stages.keys().collect();
            assert!(heard.state.is_empty() && heard.keyframe.is_empty(), "{key}");
            assert_eq!(names, ["link-base"], "{key}");
        }
        ends.kill_link(Robot);
        ends.kill_link(Base);
    }
}

#[test]
fn a_full_disk_on_the_robot_is_named_and_costs_no_keyframe() {
    let mut ends = Ends::new("");
    let folder = ends.folder.path().to_owned();
    let small = folder.join("small");
    std::fs::create_dir(&small).unwrap();
    ends.journal = small.join("link.journal");
    // A disk of the link's own, with room for some keyframes.
    let script = "mount -t tmpfs -o size=1m tmpfs \"$0\" && head -c 900k /dev/zero > \"$0/other\" && exec \"$@\"";
    let mut command = Command::new("unshare");
    command.args(["-m", "sh", "-c", script]).arg(&small);
    if !Command::new("unshare")
        .args(["-m", "true"])
        .status()
        .is_ok_and(|it| it.success())
    {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI may make its own mounts"
        );
        println!("not run: this user may not make its own mounts");
        return;
    }
    command.arg(program("link"));
    let input = log(&folder, 150);
    for name in ["odometry", "filter"] {
        ends.robot.stage(name);
    }
    ends.link(Base);
    ends.link_by(Robot, command);
    let mut both = [Heard::enter(&ends.robot), Heard::enter(&ends.base)];
    ends.robot.play(&input, &["--stay", "--rate", "3"]);
    let link = |both: &[Heard; 2]| both[0].stages.get("link").copied();
    let mut there = 0;
    listen_until("the disk is full", &mut both, |both| {
        there = both[0].keyframe.len();
        link(both).is_some_and(|it| text_of(&it.message).contains("No space left"))
    });
    listen_until("keyframes meanwhile", &mut both, |both| {
        both[0].keyframe.len() >= there + 5
    });
    assert!(both[1].keyframe.len() < both[0].keyframe.len());
    let pid = ends.links[Robot as usize].unwrap();
    let other = small.join("other");
    std::fs::remove_file(format!("/proc/{pid}/root{}", other.display())).unwrap();
    listen_until("all keyframes", &mut both, |both| {
        both[1].keyframe.len() == both[0].keyframe.len()
            && link(both).is_some_and(|it| text_of(&it.message).contains("kB/s there"))
    });
    assert_eq!(both[1].keyframe, both[0].keyframe);
    assert_eq!(link(&both).map(|it| it.lost), Some(0));
}

#[test]
fn over_a_bad_radio_poses_are_young_and_keyframes_come_whole_after_a_break() {
    // 64 kbit/s.
    let folder = tempfile::tempdir().unwrap();
    let input = log(folder.path(), 190);
    let Some(mut over) = OverRadio::new(&input, "rate=8000 delay=0.1", "") else {
        return;
    };
    listen_until("the first state", &mut over.both, |both| {
        !both[1].state.is_empty()
    });
    // The first map of the window needs some seconds.
    listen_for(Duration::from_secs(3), &mut over.both);
    let (oldest, rate) = over.measure("64 kbit/s", Duration::from_secs(12));
    assert!(oldest < 1.1, "{oldest}");
    assert!(rate < 8000.0 * 1.05, "{rate}");
    over.radio.set("down=1");
    listen_for(Duration::from_secs(4), &mut over.both);
    over.radio.set("down=0 rate=64000 loss=0.05 swap=0.05");
    let before = over.both[1].state.len();
    listen_until("a state after the break", &mut over.both, |both| {
        both[1].state.len() > before
    });
    over.measure("512 kbit/s, loss 5 %", Duration::from_secs(6));
    listen_until("keyframes", &mut over.both, |both| {
        let last = both[0].state.last_key_value();
        last.is_some_and(|(id, _)| *id >= 189) && OverRadio::has_all(both)
    });
    let [robot, base] = &over.both;
    assert_eq!(base.keyframe, robot.keyframe);
    let is_next = |pair: &[u64]| pair[1] == pair[0] + 1;
    assert!(base.order.windows(2).all(is_next), "{:?}", base.order);
    drop(over.ends);
}
