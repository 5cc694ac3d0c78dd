//! The vendor's own libphidget22, unmodified, between our driver and our emulator of a Phidget
//! network server.

use crate::support::{Drive, Driven, Emulated};
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

/// PyPI's release that the driver is tested with.
const WHEEL: &str = "phidget22-1.26.20260821-py3-none-manylinux_2_28_x86_64.whl";
const SHA256: &str = "dd7ed82e6b9e8ea6eb5333d326eebd94d764430e779ea2e5dac75c142f4fad5a";
const LIBRARY: &str = "Phidget22/.libs/libphidget22.so";

const SERIAL_NUMBER: u32 = 123_456;
/// An emulator begins this long before its first sample.
const LEAD: Duration = Duration::from_millis(500);
/// A device that is back sends within 2 s where nothing else runs; the machine of a test may be
/// slow.
const BACK_MAX: Duration = Duration::from_secs(10);
/// Marks the process of one test.
const ALONE: &str = "RANDT_TEST_ALONE";

/// The library is one a process, and its servers and threads disturb each other: each test has a
/// process of its own, and so they run side by side.
fn alone(test: &str, body: impl FnOnce()) {
    if std::env::var_os(ALONE).is_some() {
        return body();
    }
    library();
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args([&format!("vendor_library::{test}"), "--exact", "--nocapture"]);
    let output = command.env(ALONE, "1").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let printed = text(&output.stdout);
    println!("{printed}");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(printed.contains("1 passed"), "no test has this name");
}

/// A test that is run in a process of its own.
macro_rules! alone {
    ($name:ident, $body:expr) => {
        #[test]
        fn $name() {
            alone(stringify!($name), || $body);
        }
    };
}

/// The library. It is fetched once, before the first test begins its process.
fn library() -> &'static Path {
    static LIBRARY_PATH: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY_PATH.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("phidget22");
        if std::env::var_os(ALONE).is_some() {
            return folder.join(LIBRARY);
        }
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
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {errors}");
}

fn serve(drive: &Drive, address: SocketAddr, faults: &[&str]) -> (Emulated, SocketAddr) {
    let mut measurements = drive.measurements(faults, 1);
    let mut server = PhidgetServer::open(address, SERIAL_NUMBER).unwrap();
    let address = server.address();
    let emulated = Emulated::new(move |ends| server.run(&mut measurements, ends).unwrap());
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
    config.imu.device = SERIAL_NUMBER.to_string();
    config
}

/// 250 Hz by the device's own stamps, without a gap.
fn assert_even(driven: &Driven, from: usize) {
    for pair in driven.samples[from..].windows(2) {
        assert_eq!(pair[1].device_ns - pair[0].device_ns, 4_000_000);
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
    }
}

alone!(
    the_vendors_library_gives_250_hz_and_again_after_the_server_was_killed,
    streams_again()
);

fn streams_again() {
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
        assert!(back.elapsed() < BACK_MAX + LEAD, "{:?}", back.elapsed());
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

alone!(
    silence_is_noticed_and_over_when_it_is_over,
    survives("silence", "samples_lost", 1)
);
alone!(
    a_closed_connection_is_noticed_and_over_when_it_is_over,
    survives("close", "reconnects", 1)
);
alone!(
    an_unplugged_device_is_noticed_and_over_when_it_is_over,
    survives("unplug", "reconnects", 1)
);
alone!(
    junk_is_noticed_and_over_when_it_is_over,
    survives("junk", "reconnects", 1)
);
alone!(
    lost_samples_are_noticed_and_over_when_they_are_over,
    survives("lost", "samples_lost", 8)
);
alone!(
    a_clock_that_begins_anew_is_noticed_and_over_when_it_is_over,
    survives("clock-reset", "clock_resets", 1)
);

fn survives(fault: &str, counter: &str, least: u64) {
    let drive = Drive::new();
    let begin = Instant::now();
    let (_emulated, address) = serve(&drive, any_port(), &[&format!("{fault}@2+2")]);
    let mut driven = Driven::new(&config(address));
    driven.until(fault, |driven| driven.count(counter) >= least);
    driven.go_on(Duration::from_secs(4).saturating_sub(begin.elapsed()));
    let mut before = driven.samples.len();
    driven.until(fault, |driven| {
        driven.imu.link().streams() && driven.samples.len() > before
    });
    let back = begin.elapsed().saturating_sub(Duration::from_secs(4));
    println!("{fault}: back {back:?} after its end");
    assert!(back < BACK_MAX, "{fault}: {back:?}");
    // The library fires what it had waiting, then all is even.
    driven.go_on(Duration::from_secs(1));
    before = driven.samples.len();
    driven.until_samples(500);
    assert_even(&driven, before);
    assert_eq!(
        *driven.imu.link(),
        Link::Streaming,
        "{fault}: {:?}",
        driven.texts
    );
}

alone!(a_server_that_hangs_is_left_and_found_again, hangs());

/// Longer than the driver waits for the library to go on by itself.
fn hangs() {
    let drive = Drive::new();
    let begin = Instant::now();
    let (_emulated, address) = serve(&drive, any_port(), &["silence@2+8"]);
    let mut driven = Driven::new(&config(address));
    driven.until_samples(1);
    driven.until_text("sends no sample for over 0.5 s");
    driven.until_text("is gone; waiting for it");
    driven.until("back", |driven| driven.imu.link().streams());
    let back = begin.elapsed().saturating_sub(Duration::from_secs(10));
    println!("back {back:?} after its end");
    assert!(back < BACK_MAX, "{back:?}");
    let before = driven.samples.len();
    driven.until_samples(1000);
    assert_even(&driven, before);
    assert_eq!(driven.count("reconnects"), 1);
}

alone!(
    a_device_that_is_not_there_is_waited_for_without_a_spin,
    is_not_there()
);

fn is_not_there() {
    let mut usb = config(any_port());
    usb.imu.server.clear();
    usb.imu.device = "987654".to_owned();
    let mut driven = Driven::new(&usb);
    driven.until_text("no Phidget Spatial on USB; waiting for one");
    let mut driven = Driven::new(&config("127.0.0.1:1".parse().unwrap()));
    driven.until_text("no Phidget Spatial at 127.0.0.1:1; waiting for one");
    let polls = driven.polls;
    driven.go_on(Duration::from_secs(2));
    assert!(driven.polls - polls < 40, "{}", driven.polls - polls);
}
