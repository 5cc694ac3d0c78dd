//! Nodes of ROS 2 in a network of their own, as DDS sees them: by Cyclone DDS and Fast DDS.

use super::pipeline::Pipeline;
use super::stages::program;
use super::{ended_within, python};
use serde_json::Value;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Set where this program runs in a network of its own.
const NETWORK: &str = "RANDT_TEST_ROS2_NETWORK";
/// No test takes longer.
const TEST_MAX: Duration = Duration::from_secs(300);

/// What the bridge reads of a bag of ours.
pub const TOPICS: [&str; 4] = [
    "--radar-topic",
    "/radar/returns",
    "--imu-topic",
    "/imu/data",
];

/// Programs in this network; all end with it.
pub struct Nodes {
    folder: tempfile::TempDir,
    pub children: Vec<Child>,
}

impl Nodes {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            children: Vec::new(),
        }
    }

    /// Starts a program that writes into `name`.out; gives its place among the children.
    pub fn spawn(&mut self, name: &str, mut command: Command) -> usize {
        let [out, errors] = ["out", "err"].map(|end| self.file(&format!("{name}.{end}")));
        command.stdin(Stdio::null());
        command.stdout(File::create(out).unwrap());
        command.stderr(File::create(errors).unwrap());
        self.children.push(command.spawn().unwrap());
        self.children.len() - 1
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.file(name)).unwrap_or_default()
    }

    pub fn cyclone(&mut self, name: &str, arguments: &[&str]) -> usize {
        let mut command = python::script("ros2_cyclone.py").unwrap();
        command.args(arguments);
        self.spawn(name, command)
    }

    pub fn bridge(&mut self, pipeline: &Pipeline, more: &[&str]) -> usize {
        let mut command = Command::new(program("ros2"));
        command.args(more);
        pipeline.enter(&mut command);
        self.spawn("bridge", command)
    }

    /// Waits for a program that ends well.
    pub fn wait(&mut self, child: usize, name: &str) {
        let status = self.children[child].wait().unwrap();
        let texts = [
            self.text(&format!("{name}.out")),
            self.text(&format!("{name}.err")),
        ];
        assert!(status.success(), "{name}: {texts:?}");
    }

    pub fn kill(&mut self, child: usize) {
        let child = &mut self.children[child];
        // It may have ended.
        let _ = child.kill();
        child.wait().unwrap();
    }

    /// What `echo` or `offers` has printed so far.
    pub fn printed(&self, name: &str) -> Vec<Value> {
        let text = self.text(&format!("{name}.out"));
        // The last line may not be whole yet.
        let lines = text.lines();
        lines
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    }

    /// The messages of a topic that `echo` has printed.
    pub fn heard(&self, name: &str, topic: &str) -> Vec<Value> {
        let mut printed = self.printed(name);
        printed.retain(|it| it["topic"] == topic);
        printed
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        for child in 0..self.children.len() {
            self.kill(child);
        }
    }
}

/// Runs a test of this file in a network of its own. Gives whether this is it.
pub fn in_own_network(test: &str) -> bool {
    if std::env::var_os(NETWORK).is_some() {
        for arguments in [
            "link set lo up multicast on",
            "route add 224.0.0.0/4 dev lo",
        ] {
            let mut ip = Command::new("ip");
            assert!(ip.args(arguments.split(' ')).status().unwrap().success());
        }
        return true;
    }
    let own = Command::new("unshare").args(["-n", "ip", "link"]).output();
    if !own.is_ok_and(|output| output.status.success()) {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI may have its own network"
        );
        println!("skipped: this user may not have a network of its own, or there is no ip");
        return false;
    }
    // Installs what is not there yet, while there is a network.
    if python::script("ros2_cyclone.py").is_none() {
        return false;
    }
    let mut command = Command::new("unshare");
    command.arg("-n").arg(std::env::current_exe().unwrap());
    command.args([test, "--exact", "--include-ignored", "--nocapture"]);
    command.env(NETWORK, "");
    let ended = ended_within(command, TEST_MAX);
    println!("{}", ended.stdout);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
    false
}
