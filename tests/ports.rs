//! What of the pipeline can be reached from elsewhere: docs/security.md lists it, and this is all of it.

use crate::support::pipeline::{Pipeline, until};
use crate::support::stages::program;
use randt_config::Config;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::net::{TcpListener, UdpSocket};
use std::process::Command;

/// A listening TCP socket and an unconnected UDP one in /proc/net.
const LISTENS: &str = "0A";
const UNCONNECTED: &str = "07";

/// Numbers of a process's sockets.
fn sockets(pid: u32) -> BTreeSet<String> {
    let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).unwrap();
    let links = descriptors.filter_map(|entry| fs::read_link(entry.ok()?.path()).ok());
    let numbers = links.filter_map(|link| {
        let link = link.to_string_lossy().into_owned();
        Some(link.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned())
    });
    numbers.collect()
}

/// What each process can be reached by from the network: protocol and address as /proc/net has it.
fn ports(pid: u32) -> Vec<(&'static str, String)> {
    let own = sockets(pid);
    let mut found = Vec::new();
    for (protocol, state) in [
        ("tcp", LISTENS),
        ("tcp6", LISTENS),
        ("udp", UNCONNECTED),
        ("udp6", UNCONNECTED),
        ("raw", UNCONNECTED),
        ("raw6", UNCONNECTED),
    ] {
        // Without IPv6 there is no such file.
        let table = fs::read_to_string(format!("/proc/net/{protocol}")).unwrap_or_default();
        for line in table.lines().skip(1) {
            let fields: Vec<&str> = line.split_whitespace().collect();
            if fields[3] == state && own.contains(fields[9]) {
                found.push((protocol, fields[1].to_owned()));
            }
        }
    }
    found
}

/// Paths of a process's Unix sockets.
fn unix_sockets(pid: u32) -> Vec<String> {
    let own = sockets(pid);
    let table = fs::read_to_string("/proc/net/unix").unwrap();
    let rows = table.lines().skip(1);
    let rows = rows.map(|line| line.split_whitespace().collect::<Vec<_>>());
    let bound = rows.filter(|fields| own.contains(fields[6]));
    bound
        .filter_map(|fields| fields.get(7).map(|path| (*path).to_owned()))
        .collect()
}

#[test]
fn only_the_radar_and_the_viewers_have_a_port() {
    let defaults = Config::default();
    assert_eq!(defaults.radar.address, "0.0.0.0:6320");
    assert_eq!(defaults.view.listen, "127.0.0.1:8765");
    let folder = tempfile::tempdir().unwrap();
    let udp = UdpSocket::bind("0.0.0.0:0").unwrap().local_addr().unwrap();
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let tcp = free.local_addr().unwrap();
    drop(free);
    let mut pipeline = Pipeline::new("po");
    let mut processes = BTreeMap::new();
    for (name, options) in [
        ("radar", vec![format!("radar.address={udp}")]),
        (
            "imu",
            vec!["imu.source=mip".to_owned(), "imu.device=/none".to_owned()],
        ),
        ("filter", Vec::new()),
        ("odometry", Vec::new()),
        ("view", vec![format!("view.listen={tcp}")]),
    ] {
        let mut command = Command::new(program(name));
        pipeline.enter(&mut command);
        for option in options {
            command.args(["--set", &option]);
        }
        processes.insert(name, pipeline.start(name, command));
    }
    processes.insert(
        "mapper",
        pipeline.mapper(&folder.path().join("map.journal")),
    );
    processes.insert(
        "recorder",
        pipeline.record(&folder.path().join("logs"), &[]),
    );
    // Addresses as the kernel writes them: bytes in the machine's order.
    let udp = ("udp", format!("00000000:{:04X}", udp.port()));
    let loopback = u32::from_ne_bytes([127, 0, 0, 1]);
    let tcp = ("tcp", format!("{loopback:08X}:{:04X}", tcp.port()));
    until("the radar's port", || !ports(processes["radar"]).is_empty());
    until("the viewers' port", || !ports(processes["view"]).is_empty());
    for (name, pid) in &processes {
        let expected = match *name {
            "radar" => vec![udp.clone()],
            "view" => vec![tcp.clone()],
            _ => Vec::new(),
        };
        assert_eq!(ports(*pid), expected, "{name}");
        let run = pipeline.realm().run().to_string_lossy().into_owned();
        let sockets = unix_sockets(*pid);
        println!("{name}: {} Unix sockets", sockets.len());
        assert!(!sockets.is_empty(), "{name} is woken by one");
        for path in sockets {
            assert!(path.starts_with(&run), "{name}: {path}");
        }
    }
}
