//! The vendor's own libphidget22, unmodified, between our driver and our emulator of a Phidget network server.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

mod support;

use randt_config::{Config, ImuSource};
use randt_device::Link;
use randt_emulator::imu::PhidgetServer;
use sha2::{Digest, Sha256};
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use support::{Drive, Driven, Emulated};

/// PyPI's release that the driver is held against.
const WHEEL: &str = "phidget22-1.26.20260821-py3-none-manylinux_2_28_x86_64.whl";
const SHA256: &str = "dd7ed82e6b9e8ea6eb5333d326eebd94d764430e779ea2e5dac75c142f4fad5a";
const LIBRARY: &str = "Phidget22/.libs/libphidget22.so";

/// The library, fetched once.
fn library() -> &'static Path {
    static LIBRARY_PATH: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY_PATH.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("phidget22");
        let wheel = folder.join(WHEEL);
        if !wheel.is_file() {
            fs::create_dir_all(&folder).unwrap();
            run(Command::new("python3")
                .args([
                    "-m",
                    "pip",
                    "download",
                    "--no-deps",
                    "--quiet",
                    "--platform",
                ])
                .args(["manylinux_2_28_x86_64", "--only-binary=:all:", "--dest"])
                .arg(&folder)
                .arg("Phidget22==1.26.20260821"));
        }
        let sum = Sha256::digest(fs::read(&wheel).unwrap());
        let sum: String = sum.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(sum, SHA256, "{}", wheel.display());
        run(Command::new("python3")
            .args(["-m", "zipfile", "-e"])
            .args([&wheel, &folder]));
        folder.join(LIBRARY)
    })
}

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {told}");
}

fn serve(drive: &Drive, address: SocketAddr, faults: &[&str]) -> (Emulated, SocketAddr) {
    let mut moments = drive.moments(faults);
    let mut server = PhidgetServer::open(address).unwrap();
    let address = server.address();
    let emulated = Emulated::new(move |ends| server.run(&mut moments, ends).unwrap());
    (emulated, address)
}

fn any_port() -> SocketAddr {
    "127.0.0.1:0".parse().unwrap()
}

fn config(address: SocketAddr) -> Config {
    let mut config = Config::default();
    config.imu.source = ImuSource::Phidget22;
    config.imu.library = library().display().to_string();
    config.imu.server = address.to_string();
    config
}

/// 250 Hz by the device's own stamps, without a gap.
fn assert_even(driven: &Driven, from: usize) {
    for pair in driven.samples[from..].windows(2) {
        assert_eq!(pair[1].device_ns - pair[0].device_ns, 4_000_000);
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
    }
}

#[test]
fn the_vendors_library_gives_250_hz_and_again_after_the_server_was_killed() {
    let drive = Drive::new();
    let (first, address) = serve(&drive, any_port(), &[]);
    let mut driven = Driven::new(&config(address));
    let begin = Instant::now();
    driven.until_samples(1500);
    println!("1500 samples after {:?}", begin.elapsed());
    assert_eq!(*driven.imu.link(), Link::Streaming, "{:?}", driven.texts);
    assert_even(&driven, 0);
    assert_eq!(
        (driven.count("samples_lost"), driven.count("overruns")),
        (0, 0)
    );
    assert_eq!(driven.imu.is_upright(), Some(true));
    let sample = driven.samples[1000];
    assert!((sample.rate_rad_s[2] - 0.25).abs() < 1e-9, "{sample:?}");
    assert!(
        (sample.acceleration_m_s2[2] - 9.8).abs() < 1e-9,
        "{sample:?}"
    );

    drop(first);
    driven.until_text("is gone; waiting for it");
    for away in [0.5, 5.0] {
        driven.go_on(Duration::from_secs_f64(away));
        let before = driven.samples.len();
        let (again, _) = serve(&drive, address, &[]);
        let back = Instant::now();
        driven.until_samples(1);
        println!("away for {away} s: back after {:?}", back.elapsed());
        assert!(
            back.elapsed() < Duration::from_secs(4),
            "{:?}",
            back.elapsed()
        );
        driven.until_samples(1000);
        assert_even(&driven, before);
        assert_eq!(*driven.imu.link(), Link::Streaming);
        drop(again);
        driven.until_text("is gone; waiting for it");
    }
    assert_eq!(
        (driven.count("reconnects"), driven.count("clock_resets")),
        (2, 2)
    );
}
