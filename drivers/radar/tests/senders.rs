//! The senders of docs/beam-udp, in C and in Python, against the driver.

use randt_config::Config;
use randt_messages::SensorKind;
use randt_radar::Radar;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

const SWEEPS: &str = "6";

fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs/beam-udp")
        .join(name)
}

/// Starts a sender and takes its sweeps.
fn listen(ip: &str, start: impl FnOnce(&str) -> Child) {
    let port = {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.local_addr().unwrap().port()
    };
    let mut config = Config::default();
    config.radar.address = format!("{ip}:{port}");
    config.radar.interface = "127.0.0.1".to_owned();
    config.radar.receive_buffer_bytes = 100_000;
    let mut radar = Radar::new(&config).unwrap();
    let now_ns = || {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        now.as_nanos() as i64
    };
    radar.poll(now_ns(), &mut |_| panic!("no sender has begun"));
    let mut sender = start(&port.to_string());
    let mut sweeps = Vec::new();
    let deadline = Instant::now() + Duration::from_secs(60);
    while sweeps.len() < 6 {
        let counters = radar.counters();
        assert!(Instant::now() < deadline, "{:?} {counters:?}", radar.link());
        radar.poll(now_ns(), &mut |sweep| {
            sweeps.push(sweep.message(SensorKind::IsdrC));
        });
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(sender.wait().unwrap().success());
    assert_eq!(radar.lost(), 0, "{:?}", radar.counters());
    for scan in sweeps {
        let head = &scan.head.sweep;
        assert_eq!((head.beam_count, head.beams_lost), (220, 0));
        assert!((head.azimuth_step_rad - 0.02856).abs() < 1e-4);
        let turn_s = (head.end_ns - head.begin_ns) as f64 * 1e-9;
        assert!((0.19..0.6).contains(&turn_s), "{turn_s} s");
        assert_eq!(scan.items.len(), 220);
        assert!(
            scan.items
                .iter()
                .all(|item| (item.range_m - 4.83).abs() < 1e-5 && item.intensity == 25.0)
        );
    }
}

#[test]
fn the_sender_in_c() {
    let folder = std::env::temp_dir().join(format!("randt-sender-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let program = folder.join("sender");
    let compiled = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O2", "-o"])
        .arg(&program)
        .arg(docs("sender.c"))
        .status()
        .expect("cc");
    assert!(compiled.success());
    listen("127.0.0.1", |port| {
        let mut command = Command::new(&program);
        command.args(["127.0.0.1", port, SWEEPS]);
        command.spawn().unwrap()
    });
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_sender_in_python() {
    listen("127.0.0.1", |port| {
        let mut command = Command::new("python3");
        command
            .arg(docs("sender.py"))
            .args(["127.0.0.1", port, SWEEPS]);
        command.spawn().expect("python3")
    });
}

/// The same to a group, on the loopback interface.
#[test]
fn a_group_is_joined() {
    const PROGRAM: &str = "
import socket, sys
sys.path.insert(0, sys.argv.pop(1))
import sender
plain = socket.socket
def on_loopback(*kind):
    out = plain(*kind)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton('127.0.0.1'))
    return out
socket.socket = on_loopback
sender.main()
";
    const GROUP: &str = "239.255.77.7";
    listen(GROUP, |port| {
        let mut command = Command::new("python3");
        command.args(["-B", "-c", PROGRAM]).arg(docs(""));
        command
            .args([GROUP, port, SWEEPS])
            .spawn()
            .expect("python3")
    });
}
