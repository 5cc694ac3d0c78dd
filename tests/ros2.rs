//! `randt-ros2` among nodes of two other implementations of DDS: Cyclone (from PyPI) and Fast DDS
//! (Debian's libfastrtps-dev). A real ROS 2 is none of them: types, names and quality of service
//! are those of ROS 2 Jazzy, by rosbags' definitions.
//!
//! Each test has a network of its own, with loopback only.

use crate::support::pipeline::{Pipeline, signal, until};
use crate::support::ros2_nodes::{Nodes, TOPICS, in_own_network};
use crate::support::stages::program;
use crate::support::{Ended, Row, ended, pose_at, randt, recording, report, run, tum};
use rustix::process::Signal;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// Whatever ends is heard of again within this.
const BACK_MAX: Duration = Duration::from_secs(2);
/// Where the live trajectory may lie beside that of `randt run`, m.
const APART_MAX_M: f64 = 0.01;
/// How much faster than the robot a bag is played: its stamps are the sensors' in any case.
const SPEED: &str = "2";

fn good(ended: &Ended) {
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}

/// A recording as a bag of ROS 2.
fn bag(folder: &Path) -> Option<PathBuf> {
    let recording = recording("bags/room.bag")?;
    let [log, bag] = ["room.mcap", "room"].map(|name| folder.join(name));
    let mut import = randt(&["import"]);
    import.arg(&recording).arg(&log);
    good(&ended(import));
    let mut export = randt(&["log", "export", "--to", "ros2"]);
    export.arg(&log).arg("--out").arg(&bag);
    good(&ended(export));
    Some(bag)
}

/// A recording, and what `randt run` gives.
struct Known {
    bag: PathBuf,
    rows: Vec<Row>,
    scans: usize,
}

impl Known {
    fn new(folder: &Path) -> Option<Self> {
        let bag = bag(folder)?;
        let out = folder.join("run");
        good(&run(&bag, &out, &[]));
        Some(Self {
            rows: tum(&out.join("odometry.tum")),
            scans: report(&out)["scans"].as_u64().unwrap() as usize,
            bag,
        })
    }

    /// Poses by their stamps: as many as sweeps, each where the run has it.
    fn compare(&self, poses: &[(i64, f64, f64)]) {
        let mut apart_m = 0.0_f64;
        for (stamp_ns, x_m, y_m) in poses {
            let known = pose_at(&self.rows, *stamp_ns);
            let [x_m, y_m] = [x_m - known.x_m, y_m - known.y_m];
            apart_m = apart_m.max((x_m * x_m + y_m * y_m).sqrt());
        }
        println!("{} poses, apart by up to {apart_m:.4} m", poses.len());
        assert_eq!(poses.len(), self.scans);
        assert!(apart_m < APART_MAX_M, "{apart_m}");
    }
}

#[test]
fn what_cyclone_plays_gives_the_trajectory_of_a_run_and_cyclone_reads_it() {
    if !in_own_network(
        "ros2::what_cyclone_plays_gives_the_trajectory_of_a_run_and_cyclone_reads_it",
    ) {
        return;
    }
    let mut nodes = Nodes::new();
    let folder = tempfile::tempdir().unwrap();
    let Some(known) = Known::new(folder.path()) else {
        return;
    };
    let mut pipeline = Pipeline::new("ros2");
    pipeline.compute(folder.path());
    nodes.bridge(&pipeline, &TOPICS);
    nodes.cyclone("echo", &["echo"]);
    nodes.cyclone("offers", &["offers"]);
    until("health", || nodes.heard("echo", "/diagnostics").len() > 2);
    whose_the_topics_are(&nodes);

    let bag = known.bag.to_str().unwrap();
    let play = nodes.cyclone("play", &["play", bag, "--speed", SPEED]);
    // Who comes while it plays gets what was said once, at its beginning.
    std::thread::sleep(Duration::from_secs(6));
    nodes.cyclone("late", &["echo"]);
    nodes.wait(play, "play");
    assert_eq!(nodes.printed("play")[0]["acknowledged"], true);
    until("all states", || {
        nodes.heard("echo", "/randt/odometry").len() >= known.scans
            && nodes.heard("echo", "/tf").len() >= known.scans
    });
    let stamp_ns = |message: &Value| message["stamp_ns"].as_i64().unwrap();
    let states = nodes.heard("echo", "/randt/odometry");
    let number = |state: &Value, name: &str| state[name].as_f64().unwrap();
    let poses: Vec<_> = states
        .iter()
        .map(|state| (stamp_ns(state), number(state, "x"), number(state, "y")))
        .collect();
    known.compare(&poses);
    assert!(states.iter().all(|state| state["frame"] == "odom"
        && state["child"] == "base_link"
        && number(state, "variance") > 0.0));
    // The stamps of frames and filtered sweeps are the sensor's too.
    let stamps: Vec<i64> = states.iter().map(stamp_ns).collect();
    let of =
        |topic: &str| -> Vec<i64> { nodes.heard("echo", topic).iter().map(stamp_ns).collect() };
    assert_eq!(of("/tf"), stamps);
    // Best effort: the kernel may drop what comes while Python is busy.
    let points = of("/randt/radar/points");
    assert!(points.iter().all(|stamp| stamps.contains(stamp)));
    assert!(points.len() * 10 > stamps.len() * 9, "{}", points.len());
    let frames = nodes.heard("echo", "/tf").pop().unwrap()["frames"].to_string();
    assert_eq!(frames, r#"[["odom","base_link"],["map","odom"]]"#);
    // Who comes late gets mounting, map and path.
    for topic in [
        "/tf_static",
        "/randt/map",
        "/randt/path",
        "/randt/keyframes",
    ] {
        until(topic, || !nodes.heard("late", topic).is_empty());
    }
    let map = nodes.heard("late", "/randt/map").pop().unwrap();
    assert!(
        map["width"].as_u64().unwrap() > 0 && map["frame"] == "map",
        "{map}"
    );
}

/// Names, types and quality of service are those of ROS 2, and the graph says whose they are.
fn whose_the_topics_are(nodes: &Nodes) {
    let expected = [
        ("randt/odometry", "nav_msgs::msg::dds_::Odometry_", false),
        ("tf", "tf2_msgs::msg::dds_::TFMessage_", false),
        ("tf_static", "tf2_msgs::msg::dds_::TFMessage_", true),
        ("randt/map", "nav_msgs::msg::dds_::OccupancyGrid_", true),
        ("randt/path", "nav_msgs::msg::dds_::Path_", true),
        (
            "randt/keyframes",
            "geometry_msgs::msg::dds_::PoseArray_",
            true,
        ),
        (
            "randt/radar/points",
            "sensor_msgs::msg::dds_::PointCloud2_",
            false,
        ),
        (
            "diagnostics",
            "diagnostic_msgs::msg::dds_::DiagnosticArray_",
            false,
        ),
    ];
    let node = || {
        let printed = nodes.printed("offers").into_iter();
        let mut nodes = printed.filter(|it| it["node"].is_string());
        nodes.next_back()
    };
    until("the graph", || node().is_some());
    let node = node().unwrap();
    assert!(
        node["node"].as_str().unwrap().starts_with("/ros2_"),
        "{node}"
    );
    for (name, type_name, is_kept) in expected {
        let offered = nodes.heard("offers", &format!("rt/{name}"));
        let offered = offered.first().unwrap();
        assert_eq!(offered["type"], type_name);
        assert_eq!(
            (&offered["reliable"], &offered["kept"]),
            (&Value::Bool(true), &Value::Bool(is_kept))
        );
        let writers = node["writers"].as_array().unwrap();
        assert!(writers.contains(&offered["gid"]), "{name}: {node}");
    }
}

#[test]
fn what_fast_dds_plays_gives_the_trajectory_of_a_run_and_fast_dds_reads_it() {
    if !in_own_network(
        "ros2::what_fast_dds_plays_gives_the_trajectory_of_a_run_and_fast_dds_reads_it",
    ) {
        return;
    }
    let mut nodes = Nodes::new();
    let folder = tempfile::tempdir().unwrap();
    let Some(fast) = fast_dds(folder.path()) else {
        return;
    };
    let Some(known) = Known::new(folder.path()) else {
        return;
    };
    let mut pipeline = Pipeline::new("fast");
    pipeline.compute(folder.path());
    let frames = folder.path().join("frames").display().to_string();
    let write = nodes.cyclone("frames", &["frames", known.bag.to_str().unwrap(), &frames]);
    nodes.wait(write, "frames");
    nodes.bridge(&pipeline, &[&TOPICS[..], &["--services"]].concat());
    let mut echo = Command::new(&fast);
    echo.arg("echo");
    nodes.spawn("echo", echo);
    let mut play = Command::new(&fast);
    play.args(["play", &frames, SPEED]);
    let play = nodes.spawn("play", play);
    nodes.wait(play, "play");
    assert!(nodes.text("play.out").ends_with(" acknowledged\n"));
    let rows = |nodes: &Nodes| nodes.text("echo.out").lines().count();
    until("all states", || rows(&nodes) >= known.scans);
    let row = |line: &str| {
        let mut cells = line.split(' ');
        let stamp_ns = cells.next().unwrap().parse().unwrap();
        let mut number = || cells.next().unwrap().parse().unwrap();
        (stamp_ns, number(), number())
    };
    let poses: Vec<_> = nodes.text("echo.out").lines().map(row).collect();
    known.compare(&poses);

    // A service, for clients of either.
    let mut call = Command::new(&fast);
    call.args(["call", "/randt/save"]);
    let call = nodes.spawn("call", call);
    nodes.wait(call, "call");
    let said = nodes.text("call.out");
    assert!(
        said.starts_with("1 ") && said.contains("keyframes are on the disk"),
        "{said}"
    );
    let call = nodes.cyclone("call", &["call", "/randt/save"]);
    nodes.wait(call, "call");
    assert_eq!(nodes.printed("call")[0]["success"], true);
}

/// The program of Fast DDS; none where there is no such library.
pub fn fast_dds(folder: &Path) -> Option<PathBuf> {
    const HEADER: &str = "/usr/include/fastdds/dds/domain/DomainParticipant.hpp";
    if !Path::new(HEADER).is_file() {
        println!("skipped: no {HEADER} (Debian: libfastrtps-dev)");
        return None;
    }
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/support/ros2_fastdds.cpp");
    let made = folder.join("ros2_fastdds");
    let mut compile = Command::new("g++");
    compile.args(["-std=c++17", "-o"]).arg(&made).arg(source);
    compile.args(["-lfastrtps", "-lfastcdr"]);
    good(&ended(compile));
    Some(made)
}

#[test]
fn whoever_is_killed_is_heard_of_again() {
    if !in_own_network("ros2::whoever_is_killed_is_heard_of_again") {
        return;
    }
    let mut nodes = Nodes::new();
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::new("heal2");
    pipeline.compute(folder.path());
    let options = ["--services", "--namespace", "robot"];
    let mut bridge = nodes.bridge(&pipeline, &options);
    let echo = nodes.cyclone("echo", &["echo", "--namespace", "/robot"]);
    let heard = |nodes: &Nodes, name: &str| nodes.heard(name, "/robot/diagnostics").len();
    until("health", || heard(&nodes, "echo") > 2);
    for _ in 0..3 {
        nodes.kill(bridge);
        let (begin, before) = (Instant::now(), heard(&nodes, "echo"));
        bridge = nodes.bridge(&pipeline, &options);
        until("health after the bridge", || heard(&nodes, "echo") > before);
        println!("back {:?} after the bridge", begin.elapsed());
        assert!(begin.elapsed() < BACK_MAX);
    }
    // Who reads, from when Python has started.
    nodes.kill(echo);
    nodes.cyclone("other", &["echo", "--namespace", "/robot"]);
    until("the reader", || !nodes.printed("other").is_empty());
    let begin = Instant::now();
    until("health by another reader", || heard(&nodes, "other") > 0);
    println!("back {:?} after the reader", begin.elapsed());
    assert!(begin.elapsed() < BACK_MAX);
    // Who looks after dead stages takes it for a living one.
    good(&pipeline.randt(&["top", "--once"]));
    let before = heard(&nodes, "other");
    until("health after a look", || {
        heard(&nodes, "other") > before + 2
    });
    // Nothing of another network reaches its sockets.
    let sockets = Command::new("ss").args(["-lunp"]).output().unwrap();
    let sockets = String::from_utf8(sockets.stdout).unwrap();
    let own = sockets
        .lines()
        .filter(|line| line.contains("\"randt-ros2\""));
    let own: Vec<&str> = own.collect();
    assert!(
        !own.is_empty() && own.iter().all(|line| line.contains("%lo:")),
        "{own:?}"
    );
    // One that stands holds nothing up.
    let other = nodes.children.last().unwrap().id();
    signal(other, Signal::STOP);
    let call = nodes.cyclone("call", &["call", "/robot/randt/stop_mission"]);
    nodes.wait(call, "call");
    let reply = &nodes.printed("call")[0];
    // There is none; the command line says so.
    assert_eq!(reply["success"], false);
    assert!(
        reply["message"].as_str().unwrap().contains("mission"),
        "{reply}"
    );
    signal(other, Signal::CONT);
    let before = heard(&nodes, "other");
    until("health after the stop", || {
        heard(&nodes, "other") > before + 1
    });
}

/// No ROS 2 has read it: at least it is Python, and its options are the bridge's.
#[test]
fn the_launch_file_gives_options_that_the_bridge_has() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tools/bridges/ros2");
    let launch = folder.join("launch/randt.launch.py");
    let mut python = Command::new("python3");
    python.args([
        "-c",
        "import sys; compile(open(sys.argv[1]).read(), sys.argv[1], 'exec')",
    ]);
    python.arg(&launch);
    good(&ended(python));
    let mut help = Command::new(program("ros2"));
    help.arg("--help");
    let help = ended(help).stdout;
    let text = fs::read_to_string(launch).unwrap();
    let (_, options) = text.split_once("bridge = ").unwrap();
    let (options, _) = options.split_once("started = ").unwrap();
    let options: Vec<&str> = options
        .split('"')
        .filter(|it| it.starts_with("--"))
        .collect();
    assert_eq!(options.len(), 5);
    for option in options {
        assert!(help.contains(&format!("{option} <")), "{option}");
    }
}
