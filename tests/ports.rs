//! Every socket of the pipeline, of links and of bridges that can be reached from elsewhere stands
//! in docs/security.md, and there is no other.

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

/// Protocol and address as /proc/net has it.
type Port = (&'static str, String);

/// What a process can be reached by from the network, by the numbers of its sockets. The kernel
/// gives its tables piece by piece: while others open and close sockets a row may be there twice,
/// or not at all.
fn ports(pid: u32) -> BTreeMap<String, Port> {
    let own = sockets(pid);
    let mut found = BTreeMap::new();
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
                found.insert(fields[9].to_owned(), (protocol, fields[1].to_owned()));
            }
        }
    }
    found
}

/// Numbers of all UDP sockets that are bound to the device of loopback, which /proc/net does not
/// say: nothing of another network reaches them, whatever their address.
fn bound_to_loopback() -> BTreeSet<String> {
    let listed = Command::new("ss")
        .args(["-H", "-u", "-a", "-n", "-e"])
        .output();
    let listed = String::from_utf8(listed.unwrap().stdout).unwrap();
    let bound = listed.lines().filter(|line| line.contains("%lo:"));
    let numbers = bound.filter_map(|line| line.split_once(" ino:")?.1.split(' ').next());
    numbers.map(str::to_owned).collect()
}

/// A loopback address of the kernel's table, or any one of a socket that is bound to its device.
fn is_loopback(number: &str, port: &Port, bound: &BTreeSet<String>) -> bool {
    bound.contains(number) || port.1.starts_with(&loopback())
}

/// 127.0.0.1 as the kernel writes it: bytes in the machine's order.
fn loopback() -> String {
    format!("{:08X}:", u32::from_ne_bytes([127, 0, 0, 1]))
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
    let udp = ("udp", format!("00000000:{:04X}", udp.port()));
    let tcp = ("tcp", format!("{}{:04X}", loopback(), tcp.port()));
    for (name, pid) in &processes {
        let expected = match *name {
            "radar" => BTreeSet::from([udp.clone()]),
            "view" => BTreeSet::from([tcp.clone()]),
            _ => BTreeSet::new(),
        };
        until(name, || {
            let found: BTreeSet<Port> = ports(*pid).into_values().collect();
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

#[test]
fn links_and_bridges_listen_on_loopback_alone_by_default() {
    assert_eq!(Config::default().link.address, "127.0.0.1:7447");
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let address = format!("link.address={address}");
    // A base has a pipeline of its own for each robot.
    let [mut robot, mut base] = ["pr", "pb"].map(Pipeline::new);
    let start = |pipeline: &mut Pipeline, program_name, name, options: &[&str]| {
        let mut command = Command::new(program(program_name));
        pipeline.enter(&mut command);
        command.args(options);
        pipeline.start(name, without_inherited(&command))
    };
    let at_base = ["--set", "link.role=base", "--set", &address];
    let at_robot = ["--set", &address];
    let link_base = start(&mut base, "link", "link-base", &at_base);
    let link = start(&mut robot, "link", "link", &at_robot);
    let bridge = start(&mut robot, "ros2", "ros2", &[]);
    let is_kept = |pid| {
        let bound = bound_to_loopback();
        let found = ports(pid);
        found
            .iter()
            .all(|(number, port)| is_loopback(number, port, &bound))
    };
    until("the port of the base", || !ports(link_base).is_empty());
    assert_eq!(ports(link_base).len(), 1);
    assert!(is_kept(link_base), "{:?}", ports(link_base));
    // By DDS's rule for the first domain.
    let discovery = format!(":{:04X}", 7400);
    until("the bridge's discovery", || {
        let found = ports(bridge);
        found
            .values()
            .any(|(_, address)| address.ends_with(&discovery))
    });
    assert!(is_kept(bridge), "{:?}", ports(bridge));
    assert_eq!(ports(link), BTreeMap::new());
}
