//! `randt-ros1` among the nodes of a real ROS 1, Debian's. Where there is none the tests say so.

use crate::support::pipeline::{Pipeline, until};
use crate::support::stages::program;
use crate::support::{Ended, ended, randt, recording, report, run, tum};
use serde_json::Value;
use std::fs::{self, File};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const ROSCORE: &str = "/usr/bin/roscore";
/// Whatever ends is heard of again within this, s.
const BACK_MAX: Duration = Duration::from_secs(2);
/// Where the live trajectory may lie beside that of `randt run`, m.
const APART_MAX_M: f64 = 0.01;

/// A master, and programs that find it; all end with it.
struct Ros {
    folder: tempfile::TempDir,
    port: u16,
    children: Vec<Child>,
}

impl Ros {
    fn start() -> Option<Self> {
        if !Path::new(ROSCORE).is_file() {
            println!("skipped: no {ROSCORE} (Debian: python3-roslaunch and others, see .ci/run)");
            return None;
        }
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut ros = Self {
            folder: tempfile::tempdir().unwrap(),
            port: free.local_addr().unwrap().port(),
            children: Vec::new(),
        };
        drop(free);
        ros.start_core();
        Some(ros)
    }

    fn start_core(&mut self) -> usize {
        let port = self.port.to_string();
        let core = self.spawn("core", self.command(ROSCORE, &["-p", &port]));
        // rostopic does not wait for it.
        until("the master", || {
            TcpStream::connect(("127.0.0.1", self.port)).is_ok()
        });
        core
    }

    fn command(&self, program: impl AsRef<Path>, arguments: &[&str]) -> Command {
        let mut command = Command::new(program.as_ref());
        command
            .args(arguments)
            .env("ROS_MASTER_URI", format!("http://127.0.0.1:{}", self.port))
            .env("ROS_IP", "127.0.0.1")
            .env("ROS_HOME", self.folder.path())
            .env("PYTHONUNBUFFERED", "1");
        command
    }

    /// Starts a program that writes into a file; gives its place among the children.
    fn spawn(&mut self, name: &str, mut command: Command) -> usize {
        let [out, errors] = ["out", "err"].map(|end| self.file(&format!("{name}.{end}")));
        command
            .stdin(Stdio::null())
            .stdout(File::create(out).unwrap());
        command.stderr(File::create(errors).unwrap());
        self.children.push(command.spawn().unwrap());
        self.children.len() - 1
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.file(name)).unwrap_or_default()
    }

    /// Prints the messages of a topic into `name`.out, a row each.
    fn echo(&mut self, name: &str, topic: &str, more: &[&str]) -> usize {
        let mut arguments = vec!["echo", "-p", "--nostr"];
        arguments.extend(more);
        arguments.push(topic);
        let command = self.command("/usr/bin/rostopic", &arguments);
        self.spawn(name, command)
    }

    fn rows(&self, name: &str) -> usize {
        self.text(&format!("{name}.out")).lines().count()
    }

    fn bridge(&mut self, pipeline: &Pipeline, more: &[&str]) -> usize {
        let mut command = self.command(program("ros1"), more);
        pipeline.enter(&mut command);
        self.spawn("bridge", command)
    }

    fn end(&mut self, child: usize) {
        let child = &mut self.children[child];
        // It may have ended.
        let _ = child.kill();
        child.wait().unwrap();
    }
}

impl Drop for Ros {
    fn drop(&mut self) {
        for child in 0..self.children.len() {
            self.end(child);
        }
        // roscore's own children, which a killed one leaves: their logs are in its folder.
        let mut kill = Command::new("pkill");
        let _ = kill.args(["-9", "-f"]).arg(self.folder.path()).status();
    }
}

/// What `randt top` says of the stage.
fn health(pipeline: &Pipeline) -> Value {
    let top = pipeline.randt(&["top", "--once", "--json"]);
    good(&top);
    let top: Value = serde_json::from_str(&top.stdout).unwrap();
    let stages = top["stages"].as_array().unwrap();
    let found = stages.iter().find(|stage| stage["name"] == "ros1");
    found.unwrap().clone()
}

fn good(ended: &Ended) {
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}

/// A recording as a bag of ours, which rosbag plays: of the recording itself its lz4 refuses a
/// part.
fn bag(folder: &Path) -> Option<PathBuf> {
    let recording = recording("bags/room.bag")?;
    let [log, bag] = ["room.mcap", "room.bag"].map(|name| folder.join(name));
    let mut import = randt(&["import"]);
    import.arg(&recording).arg(&log);
    good(&ended(import));
    let mut export = randt(&["log", "export", "--to", "ros1"]);
    export.arg(&log).arg("--out").arg(&bag);
    good(&ended(export));
    Some(bag)
}

#[test]
fn what_rosbag_plays_gives_the_trajectory_of_a_run_and_ros_reads_it() {
    let Some(mut ros) = Ros::start() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let Some(bag) = bag(folder.path()) else {
        return;
    };
    let out = folder.path().join("run");
    good(&run(&bag, &out, &[]));
    let scans = report(&out)["scans"].as_u64().unwrap();

    let mut pipeline = Pipeline::new("ros1");
    pipeline.compute(folder.path());
    let topics = [
        "--radar-topic",
        "/radar/returns",
        "--imu-topic",
        "/imu/data",
    ];
    ros.bridge(&pipeline, &topics);
    ros.echo("states", "/randt/odometry", &[]);
    ros.echo("frames", "/tf/transforms[0]/header/stamp", &[]);
    ros.echo("health", "/diagnostics/header/stamp", &[]);
    until("the node of ROS", || ros.rows("health") > 2);
    // rostopic asks the master once a second.
    std::thread::sleep(Duration::from_secs(2));
    let play = ros.command("/usr/bin/rosbag", &["play", "-q", bag.to_str().unwrap()]);
    let play = ros.spawn("play", play);
    // Who comes while it plays gets what was said once, at its beginning.
    std::thread::sleep(Duration::from_secs(2));
    ros.echo(
        "mounting",
        "/tf_static/transforms[0]/child_frame_id",
        &["-n", "1"],
    );
    until("transforms said once", || ros.rows("mounting") == 2);
    assert!(
        ros.children[play].wait().unwrap().success(),
        "{}",
        ros.text("play.err")
    );
    // rostopic's heading is a row too.
    let all = scans as usize + 1;
    until("all states", || {
        ros.rows("states") >= all && ros.rows("frames") >= all
    });

    let rows = tum(&out.join("odometry.tum"));
    let states = ros.text("states.out");
    let mut lines = states.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|it| *it == name).unwrap();
    let stamp = column("field.header.stamp");
    let [x, y] = ["x", "y"].map(|axis| column(&format!("field.pose.pose.position.{axis}")));
    let (mut apart_m, mut stamps) = (0.0_f64, Vec::new());
    for line in lines {
        let fields: Vec<f64> = line.split(',').map(|it| it.parse().unwrap()).collect();
        let stamp_ns: i64 = line.split(',').nth(stamp).unwrap().parse().unwrap();
        stamps.push(stamp_ns);
        let known = crate::support::pose_at(&rows, stamp_ns);
        let [x_m, y_m] = [fields[x] - known.x_m, fields[y] - known.y_m];
        apart_m = apart_m.max((x_m * x_m + y_m * y_m).sqrt());
    }
    assert_eq!(stamps.len(), scans as usize);
    println!("apart by up to {apart_m:.4} m");
    assert!(apart_m < APART_MAX_M, "{apart_m}");
    // The stamps are the sensor's, of the transforms too.
    let frames = ros.text("frames.out");
    let frames: Vec<i64> = frames
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(frames, stamps);

    // Who comes late gets map and path.
    for (name, topic) in [
        ("map", "/randt/map/info"),
        ("path", "/randt/path/header"),
        ("keyframes", "/randt/keyframes/header"),
    ] {
        ros.echo(name, topic, &["-n", "1"]);
        until(topic, || ros.rows(name) == 2);
    }
}

#[test]
fn whatever_ends_is_heard_of_again() {
    let Some(mut ros) = Ros::start() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::new("heal");
    pipeline.compute(folder.path());
    let bridge = ros.bridge(&pipeline, &[]);
    let listen = |ros: &mut Ros, name: &str| {
        let echo = ros.echo(name, "/diagnostics/header/stamp", &[]);
        until(name, || ros.rows(name) > 2);
        echo
    };
    listen(&mut ros, "first");

    // The node of ROS.
    let child = ros.children[bridge].id();
    let killed = Command::new("pkill")
        .args(["-9", "-P", &child.to_string()])
        .status();
    assert!(killed.unwrap().success());
    let (begin, before) = (Instant::now(), ros.rows("first"));
    until("health after the node", || ros.rows("first") > before + 1);
    let node = begin.elapsed();

    // The stage.
    ros.end(bridge);
    let bridge = ros.bridge(&pipeline, &[]);
    let (begin, before) = (Instant::now(), ros.rows("first"));
    until("health after the stage", || ros.rows("first") > before + 1);
    let stage = begin.elapsed();
    println!("back after the node {node:?}, after the stage {stage:?}");
    // Health comes once a second.
    for back in [node, stage] {
        assert!(back < BACK_MAX + Duration::from_secs(1), "{back:?}");
    }

    // A node that stands holds nothing up.
    let of_bridge = ["-P", &ros.children[bridge].id().to_string()].map(str::to_owned);
    let signal = |signal: &str| {
        let mut pkill = Command::new("pkill");
        assert!(
            pkill
                .arg(signal)
                .args(&of_bridge)
                .status()
                .unwrap()
                .success()
        );
    };
    signal("-STOP");
    std::thread::sleep(Duration::from_secs(3));
    let health = health(&pipeline);
    assert_eq!(health["state"], "running", "{health}");
    signal("-CONT");
    let before = ros.rows("first");
    until("health after the stop", || ros.rows("first") > before + 1);

    // The master, which forgets all nodes.
    ros.end(0);
    let port = format!("{}", ros.port);
    let _ = Command::new("pkill")
        .args(["-f", &format!("rosmaster.*{port}")])
        .status();
    std::thread::sleep(Duration::from_secs(1));
    ros.start_core();
    listen(&mut ros, "second");
    assert!(ros.children[bridge].try_wait().unwrap().is_none());
}

#[test]
fn what_does_not_come_and_what_is_no_radar_is_named() {
    let Some(mut ros) = Ros::start() else {
        return;
    };
    let mut pipeline = Pipeline::new("named");
    pipeline.stage("filter");
    ros.bridge(
        &pipeline,
        &["--radar-topic", "/radar", "--imu-topic", "/imu"],
    );
    let message = |pipeline: &Pipeline| health(pipeline)["message"].to_string();
    let silent = "no message on /radar for more than 2 s";
    until("the silent topic", || message(&pipeline).contains(silent));
    for (name, topic, type_name) in [
        ("imu", "/imu", "sensor_msgs/Imu"),
        ("radar", "/radar", "std_msgs/String"),
    ] {
        let publish = ros.command(
            "/usr/bin/rostopic",
            &["pub", "-r", "5", topic, type_name, "{}"],
        );
        ros.spawn(name, publish);
    }
    let other = "/radar is std_msgs/String";
    until("the other type", || message(&pipeline).contains(other));
    assert!(health(&pipeline)["lost"].as_u64().unwrap() > 0);
}
