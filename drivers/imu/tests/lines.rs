//! Text lines, by a serial port and by datagrams, whole and broken.

use crate::support::{Drive, Driven};
use randt_config::{Config, ImuSource, SenderPin};
use randt_device::Link;
use randt_emulator::imu::SerialProtocol;
use std::net::{SocketAddr, UdpSocket};

/// An address of this host that nobody listens on.
fn free_address() -> SocketAddr {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.local_addr().unwrap()
}

fn by_udp(drive: &Drive, address: SocketAddr) -> Config {
    let mut config = drive.config(ImuSource::Line);
    config.imu.device = address.to_string();
    config
}

/// What every sample and velocity of the drive is, in order.
fn assert_whole(driven: &Driven) {
    for pair in driven.samples.windows(2) {
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
        assert!(pair[1].device_ns > pair[0].device_ns);
    }
    for sample in &driven.samples {
        assert_eq!(sample.rate_rad_s, [0.01, -0.02, 0.25]);
        assert_eq!(sample.acceleration_m_s2, [0.1, 0.2, 9.8]);
    }
    for pair in driven.twists.windows(2) {
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
    }
    for twist in &driven.twists {
        assert_eq!(twist.velocity, [0.5, 0.0, 0.25]);
        assert_eq!((twist.covariance[0], twist.covariance[4]), (0.0625, 0.0));
    }
    // A fifth of the samples.
    let fifths = driven.samples.len() / 5;
    assert!(driven.twists.len().abs_diff(fifths) < fifths / 4 + 5);
}

#[test]
fn lines_of_a_serial_port_are_samples_and_velocities_whatever_comes_between() {
    let drive = Drive::new();
    let faults = [
        "junk@1+0.3",
        "checksum@1.3+0.3",
        "cut@1.6+0.3",
        "split@1.9+0.3",
    ];
    let more = ["oversize@2.2+0.3", "doubled@2.5+0.3", "lost@2.8+0.4"];
    let _emulated = drive.serial(SerialProtocol::Line, &[&faults[..], &more].concat());
    let mut driven = Driven::new(&drive.config(ImuSource::Line));
    driven.until("lines", |driven| driven.samples.len() > 800);
    assert_whole(&driven);
    assert_eq!(*driven.imu.link(), Link::Streaming);
    assert_eq!(driven.imu.is_upright(), Some(true));
    for (name, least) in [
        ("checksum_errors", 5),
        ("lines_malformed", 5),
        ("lines_of_another_kind", 5),
        ("lines_doubled", 5),
        ("samples_lost", 20),
    ] {
        assert!(
            driven.count(name) >= least,
            "{name}: {}",
            driven.count(name)
        );
    }
    assert_eq!(driven.count("clock_resets") + driven.count("reconnects"), 0);
}

#[test]
fn datagrams_are_taken_in_order_and_from_one_sender() {
    let drive = Drive::new();
    let address = free_address();
    let config = by_udp(&drive, address);
    let mut driven = Driven::new(&config);
    driven.until_text("UDP 127.0.0.1:");
    let _emulated = drive.lines(address, &["reordered@0.7+0.5", "doubled@1.2+0.5"]);
    driven.until_samples(200);
    // Another one that sends lines, and one that sends nothing of the kind.
    let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
    for _ in 0..20 {
        stranger.send_to(b"imu,1,,9,9,9,9,9,9", address).unwrap();
        stranger.send_to(b"hello", address).unwrap();
        driven.until_samples(5);
    }
    driven.until_text("set imu.sender");
    driven.until("order", |driven| driven.samples.len() > 450);
    assert_whole(&driven);
    assert!(driven.count("datagrams_of_another_sender") >= 40);
    assert!(driven.count("lines_out_of_order") >= 5 && driven.count("lines_doubled") >= 5);
    driven.until("the stranger is silent", |driven| {
        *driven.imu.link() == Link::Streaming
    });
}

#[test]
fn whom_the_configuration_excludes_changes_nothing() {
    let drive = Drive::new();
    let address = free_address();
    let mut config = by_udp(&drive, address);
    config.imu.sender = SenderPin {
        ip: Some("192.0.2.1".parse().unwrap()),
        port: None,
    };
    let mut driven = Driven::new(&config);
    let _emulated = drive.lines(address, &[]);
    driven.until_text("is imu.sender right?");
    assert!(driven.samples.is_empty() && driven.twists.is_empty());
    assert!(driven.count("datagrams_of_another_sender") > 0);
}

#[test]
fn wheels_may_have_a_wire_of_their_own() {
    let drive = Drive::new();
    let address = free_address();
    let mut config = drive.config(ImuSource::Mip);
    config.imu.twist_device = address.to_string();
    let _imu = drive.serial(SerialProtocol::Mip, &[]);
    let mut driven = Driven::new(&config);
    assert!(driven.imu.has_twists());
    driven.until_text("robot/twist: UDP 127.0.0.1:");
    // An IMU that goes without wheels is no IMU that is gone.
    assert!(driven.imu.link().streams() && driven.samples.len() > 100);
    let _wheels = drive.lines(address, &["lost@0+0"]);
    driven.until("wheels", |driven| driven.twists.len() > 20);
    assert_eq!(*driven.imu.link(), Link::Streaming);
    assert_eq!(driven.count("twists_lost"), 0);
    assert!(
        driven
            .samples
            .iter()
            .all(|sample| sample.rate_rad_s[0] < 0.1)
    );
}
