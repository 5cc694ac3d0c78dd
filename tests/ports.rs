//! Every socket of the pipeline that can be reached from elsewhere stands in docs/security.md, and
//! there is no other.

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
/// The kernel gives its tables piece by piece: while others open and close sockets a row may be
/// there twice, or not at all.
fn ports(pid: u32) -> BTreeSet<(&'static str, String)> {
    let own = sockets(pid);
    let mut found = BTreeSet::new();
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
                found.insert((protocol, fields[1].to_owned()));
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

/// The same command without the sockets that this process has open: other tests in it are stages
/// themselves, and iceoryx2's sockets are inherited.
fn without_inherited(command: &Command) -> Command {
    let mut alone = Command::new("bash");
    let script = "for fd in /proc/$$/fd/*; do fd=${fd##*/}; [ $fd -le 2 ] || eval \"exec $fd>&-\"; done; exec \"$0\" \"$@\"";
    alone.args(["-c", script]).arg(command.get_program());
    alone.args(command.get_args());
    alone
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
    let at = |name: &str| folder.path().join(name).display().to_string();
    for (name, options) in [
        (
            "radar",
            vec!["--set".to_owned(), format!("radar.address={udp}")],
        ),
        (
            "imu",
            ["--set", "imu.source=mip", "--set", "imu.device=/none"]
                .map(str::to_owned)
                .to_vec(),
        ),
        ("filter", Vec::new()),
        ("odometry", Vec::new()),
        (
            "view",
            vec!["--set".to_owned(), format!("view.listen={tcp}")],
        ),
        ("mapper", vec!["--journal".to_owned(), at("map.journal")]),
        ("recorder", vec!["--out".to_owned(), at("logs")]),
    ] {
        let mut command = Command::new(program(name));
        pipeline.enter(&mut command);
        command.args(options);
        processes.insert(name, pipeline.start(name, without_inherited(&command)));
    }
    // Addresses as the kernel writes them: bytes in the machine's order.
    let udp = ("udp", format!("00000000:{:04X}", udp.port()));
    let loopback = u32::from_ne_bytes([127, 0, 0, 1]);
    let tcp = ("tcp", format!("{loopback:08X}:{:04X}", tcp.port()));
    for (name, pid) in &processes {
        let expected = match *name {
            "radar" => BTreeSet::from([udp.clone()]),
            "view" => BTreeSet::from([tcp.clone()]),
            _ => BTreeSet::new(),
        };
        until(name, || {
            let found = ports(*pid);
            assert!(found.is_subset(&expected), "{name}: {found:?}");
            found == expected
        });
        let run = pipeline.domain().run().to_string_lossy().into_owned();
        let mut sockets = Vec::new();
        until("a socket to be woken by", || {
            sockets = unix_sockets(*pid);
            !sockets.is_empty()
        });
        println!("{name}: {} Unix sockets", sockets.len());
        for path in sockets {
            assert!(path.starts_with(&run), "{name}: {path}");
        }
    }
}
