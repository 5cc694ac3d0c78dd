//! The radar's network: the cable is pulled, or its adapter goes and comes back as a new one. The
//! driver reports it, and sweeps come again.
//!
//! Robot and radar have namespaces of their own, with a pair of Ethernet devices between them.

use crate::support::pipeline::until;
use crate::support::stages::{RunFolder, Running};
use crate::support::{drive, ended_within, randt};
use randt_messages::{RadarScan, StageHealthTopic, StageState, health::text_of};
use randt_stage::{Domain, Observer, Registry, Subscriber};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Tells this program that it runs in the robot's namespace, and where the log is.
const LOG: &str = "RANDT_TEST_LINKS_LOG";
const SCANS: u64 = 120;
/// What is wrong is reported, and sweeps come again, within 2 s; a busy machine has as much again.
const REPORTED_MAX: Duration = Duration::from_secs(4);
const AWAY: Duration = Duration::from_secs(2);
const WAIT_MAX: Duration = Duration::from_secs(30);

#[test]
fn a_network_that_is_unplugged_and_plugged_in_again_is_reported_and_sweeps_come_again() {
    let own = Command::new("unshare").args(["-n", "ip", "link"]).output();
    if !own.is_ok_and(|output| output.status.success()) {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI may have its own network"
        );
        println!("not run: this user may not have a network of its own, or there is no ip");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    drive::write(&drive::events(SCANS), &log);
    let mut command = Command::new("unshare");
    command.arg("-n").arg(std::env::current_exe().unwrap());
    command.args(["links::in_the_robots_network", "--exact", "--nocapture"]);
    command.env(LOG, &log);
    let ended = ended_within(command, Duration::from_secs(120));
    println!("{}", ended.stdout);
    assert_eq!(ended.code, Some(0), "{}{}", ended.stdout, ended.stderr);
}

#[test]
fn in_the_robots_network() {
    let Some(log) = std::env::var_os(LOG).map(PathBuf::from) else {
        return;
    };
    ip(&["link", "set", "lo", "up"]);
    let network = Network::new();
    let folder = RunFolder::new();
    for (i, (protocol, heard, sent)) in [
        // Heard from a group, from one radar alone, and by a connection.
        ("beam-udp", "239.7.7.7:6320", "239.7.7.7:6320"),
        ("beam-udp", "0.0.0.0:6320", "192.168.7.1:6320"),
        ("navtech", "192.168.7.2:6317", "192.168.7.2:6317"),
    ]
    .into_iter()
    .enumerate()
    {
        let robot = folder.file(&format!("robot-{i}.toml"));
        let interface = if heard == sent && protocol == "beam-udp" {
            "interface = \"192.168.7.1\"\n"
        } else {
            ""
        };
        let text = format!("[radar]\nsource = \"{protocol}\"\naddress = \"{heard}\"\n{interface}");
        std::fs::write(&robot, text).unwrap();
        let domain = folder.domain(&format!("links{i}"));
        let _radar = network.radar(protocol, sent, &log);
        let mut command = RunFolder::command(&domain, "radar");
        command.arg("--robot").arg(&robot);
        let mut driver = Driver::new(&domain, folder.start("radar", command));
        driver.scans_after(Instant::now(), "the first");
        for (how, unplug, plug_in) in [
            (
                "cable",
                Network::pull as fn(&Network),
                Network::push as fn(&Network),
            ),
            ("adapter", Network::take_away, Network::bring_back),
        ] {
            unplug(&network);
            let gone = driver.is_wrong_after(Instant::now());
            driver.listen_for(AWAY.saturating_sub(gone));
            plug_in(&network);
            let back = driver.scans_after(Instant::now(), how);
            println!(
                "{protocol} {heard}, {how}: reported after {gone:.2?}, scans again after {back:.2?}"
            );
            assert!(
                gone < REPORTED_MAX && back < REPORTED_MAX,
                "{protocol} {how}"
            );
        }
    }
}

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {printed}");
}

fn ip(arguments: &[&str]) {
    run(Command::new("ip").args(arguments));
}

/// The robot's network is that of this program, the radar's another one; a third one is where an
/// adapter is when it is not plugged in.
struct Network {
    radar: Child,
    away: Child,
}

impl Network {
    fn new() -> Self {
        let namespace = || {
            let mut command = Command::new("unshare");
            command.args(["-n", "sleep", "1000"]);
            command.stdin(Stdio::null()).spawn().unwrap()
        };
        let network = Self {
            radar: namespace(),
            away: namespace(),
        };
        let own = std::fs::read_link("/proc/self/ns/net").unwrap();
        for child in [&network.radar, &network.away] {
            let its = format!("/proc/{}/ns/net", child.id());
            until("a network", || {
                std::fs::read_link(&its).is_ok_and(|its| its != own)
            });
        }
        let radar = network.radar.id().to_string();
        ip(&[
            "link", "add", "robot0", "type", "veth", "peer", "name", "radar0", "netns", &radar,
        ]);
        network.radars(&["addr", "add", "192.168.7.2/24", "dev", "radar0"]);
        network.radars(&["link", "set", "radar0", "up"]);
        network.radars(&["route", "add", "239.0.0.0/8", "dev", "radar0"]);
        network.address();
        network
    }

    fn within(child: &Child) -> Command {
        let mut command = Command::new("nsenter");
        command.args(["-t", &child.id().to_string(), "-n"]);
        command
    }

    fn radars(&self, arguments: &[&str]) {
        run(Self::within(&self.radar).arg("ip").args(arguments));
    }

    fn address(&self) {
        ip(&["addr", "add", "192.168.7.1/24", "dev", "robot0"]);
        self.push();
    }

    fn pull(&self) {
        ip(&["link", "set", "robot0", "down"]);
    }

    fn push(&self) {
        ip(&["link", "set", "robot0", "up"]);
    }

    fn take_away(&self) {
        ip(&[
            "link",
            "set",
            "robot0",
            "netns",
            &self.away.id().to_string(),
        ]);
    }

    fn bring_back(&self) {
        let own = std::process::id().to_string();
        let command = &mut Self::within(&self.away);
        run(command.args(["ip", "link", "set", "robot0", "netns", &own]));
        self.address();
    }

    /// The emulated radar.
    fn radar(&self, protocol: &str, address: &str, log: &Path) -> Emulated {
        let randt = randt(&[]);
        let mut command = Self::within(&self.radar);
        command.arg(randt.get_program());
        command.args([
            "emulate",
            "radar",
            "--proto",
            protocol,
            "--address",
            address,
        ]);
        command.arg("--log").arg(log);
        command.args(["--parent", &std::process::id().to_string()]);
        command.stdin(Stdio::null()).stdout(Stdio::null());
        Emulated(command.spawn().unwrap())
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for child in [&mut self.radar, &mut self.away] {
            // They do nothing but wait.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

struct Emulated(Child);

impl Drop for Emulated {
    fn drop(&mut self) {
        let ended = self.0.try_wait();
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
        if !std::thread::panicking() {
            assert!(
                matches!(ended, Ok(None)),
                "the emulated radar has ended: {ended:?}"
            );
        }
    }
}

/// The driver, and what it publishes.
struct Driver {
    process: Running,
    observer: Observer,
    health: Subscriber<StageHealthTopic>,
    scans: Subscriber<RadarScan>,
}

impl Driver {
    fn new(domain: &Domain, process: Running) -> Self {
        let runs = |(entry, lives): &(randt_stage::Entry, bool)| *lives && entry.topics.len() > 1;
        until("the driver", || Registry::all(domain).iter().any(runs));
        let observer = Observer::enter(domain).unwrap().unwrap();
        Self {
            process,
            health: observer.subscriber().unwrap(),
            scans: observer.subscriber().unwrap(),
            observer,
        }
    }

    fn listen_for(&mut self, time: Duration) {
        let begin = Instant::now();
        while begin.elapsed() < time {
            self.listen();
        }
    }

    /// Scans that came, and the last word on whether something is wrong.
    fn listen(&mut self) -> (usize, Option<bool>) {
        std::thread::sleep(Duration::from_millis(20));
        let (mut scans, mut is_wrong) = (0, None);
        self.observer.read(&mut self.scans, |_| scans += 1).unwrap();
        let health = self.observer.read(&mut self.health, |message| {
            let head = message.head;
            if text_of(&head.name) == "radar" {
                is_wrong = Some(head.state == StageState::Degraded as u32);
            }
        });
        health.unwrap();
        (scans, is_wrong)
    }

    /// How long after an instant it reports that something is wrong.
    fn is_wrong_after(&mut self, from: Instant) -> Duration {
        while self.listen().1 != Some(true) {
            assert!(
                from.elapsed() < WAIT_MAX,
                "nothing reported: {}",
                self.process.stderr()
            );
        }
        from.elapsed()
    }

    /// How long after an instant scans come.
    fn scans_after(&mut self, from: Instant, what: &str) -> Duration {
        while self.listen().0 == 0 {
            assert!(
                from.elapsed() < WAIT_MAX,
                "{what}: no scan: {}",
                self.process.stderr()
            );
        }
        from.elapsed()
    }
}
