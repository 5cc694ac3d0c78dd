//! Serial IMUs over a pseudo-terminal: every way in which one can be missing, wrong or broken.

use crate::support::{Drive, Driven};
use randt_config::ImuSource;
use randt_device::Link;
use randt_emulator::imu::SerialProtocol;
use std::fs;
use std::time::{Duration, Instant};

/// A device that is back sends within 2 s where nothing else runs; the machine of a test may be
/// slow.
const BACK_MAX: Duration = Duration::from_secs(10);
/// After a fault the driver is steady again within this time.
const SETTLED: Duration = Duration::from_secs(2);

const BOTH: [(ImuSource, SerialProtocol); 2] = [
    (ImuSource::Mip, SerialProtocol::Mip),
    (ImuSource::Xsens, SerialProtocol::Xsens),
];

#[test]
fn samples_come_at_their_rate_and_in_si_units() {
    let drive = Drive::new();
    for (source, protocol) in BOTH {
        let _emulated = drive.serial(protocol, &[]);
        let mut driven = Driven::new(&drive.config(source));
        driven.until_samples(1500);
        assert_eq!(*driven.imu.link(), Link::Streaming);
        assert_eq!(driven.imu.is_upright(), Some(true));
        for name in [
            "samples_lost",
            "unknown_values",
            "checksum_errors",
            "overruns",
            "clock_resets",
        ] {
            assert_eq!(driven.count(name), 0, "{name}");
        }
        for pair in driven.samples.windows(2) {
            let step_ns = pair[1].device_ns - pair[0].device_ns;
            assert_eq!(step_ns, 4_000_000);
            assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
        }
        for sample in &driven.samples {
            // A burst, on a busy machine a long one, may be spread into the future: stamps rise by
            // half an interval at least.
            let late_ns = sample.arrival_ns - sample.header.stamp_ns;
            assert!(late_ns.abs() < 1_000_000_000, "{late_ns}");
            assert!((sample.rate_rad_s[2] - 0.25).abs() < 1e-6);
            assert!((sample.acceleration_m_s2[2] - 9.8).abs() < 1e-5);
        }
    }
}

#[test]
fn a_device_that_is_not_there_is_waited_for_without_a_spin() {
    let drive = Drive::new();
    let mut driven = Driven::new(&drive.config(ImuSource::Mip));
    driven.until_text("imu: not there; trying again");
    let polls = driven.polls;
    driven.go_on(Duration::from_secs(2));
    assert!(driven.polls - polls < 40, "{}", driven.polls - polls);
    let _emulated = drive.serial(SerialProtocol::Mip, &[]);
    let begin = Instant::now();
    driven.until_samples(1);
    assert!(begin.elapsed() < BACK_MAX, "{:?}", begin.elapsed());
    driven.until_samples(500);
    assert_eq!(*driven.imu.link(), Link::Streaming);
}

#[test]
fn a_device_that_is_plugged_in_again_is_found_under_its_other_name() {
    let drive = Drive::new();
    let emulated = drive.serial(SerialProtocol::Mip, &[]);
    let mut driven = Driven::new(&drive.config(ImuSource::Mip));
    driven.until_samples(500);
    let first = fs::read_link(drive.path("imu")).unwrap();
    // Its terminal stays in use, so that the kernel gives another name.
    let _other = drive_another();
    drop(emulated);
    driven.until_text("imu: ");
    let texts: Vec<&str> = driven.texts.iter().map(|(_, text)| &text[..]).collect();
    assert!(texts.last().unwrap().contains("unplugged"), "{texts:?}");
    driven.until_text("not there; trying again");
    let _taken = drive_another();
    let _emulated = drive.serial(SerialProtocol::Mip, &[]);
    let begin = Instant::now();
    assert_ne!(fs::read_link(drive.path("imu")).unwrap(), first);
    driven.until_samples(1);
    assert!(begin.elapsed() < BACK_MAX, "{:?}", begin.elapsed());
    driven.until_samples(500);
    assert_eq!(
        (driven.count("reconnects"), driven.count("clock_resets")),
        (1, 1)
    );
    assert_eq!(*driven.imu.link(), Link::Streaming);
    for pair in driven.samples.windows(2) {
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns);
    }
}

/// A terminal of another program.
fn drive_another() -> randt_emulator::imu::SerialImu {
    randt_emulator::imu::SerialImu::open(SerialProtocol::Xsens, None).unwrap()
}

#[test]
fn what_is_no_device_is_named_and_tried_again() {
    let drive = Drive::new();
    let mut config = drive.config(ImuSource::Mip);
    config.imu.device.clear();
    let refused = randt_imu::Imu::new(&config)
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(refused.contains("imu.device is \"\""), "{refused}");
    let config = drive.config(ImuSource::Mip);
    let mut driven = Driven::new(&config);
    crate::support::write(&drive.path("imu"), b"no device");
    driven.until_text("imu: is a file, not a serial port");
    fs::remove_file(drive.path("imu")).unwrap();
    fs::create_dir(drive.path("imu")).unwrap();
    driven.until_text("imu: is a directory, not a serial port");
    fs::remove_dir(drive.path("imu")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", drive.path("imu")).unwrap();
    driven.until_text("imu: is another device, not a serial port");
    fs::remove_file(drive.path("imu")).unwrap();
    // Another protocol's device.
    let other = drive.serial(SerialProtocol::Xsens, &["junk@0+100"]);
    driven.until_text("no sample for over 0.5 s");
    drop(other);
    let _emulated = drive.serial(SerialProtocol::Mip, &[]);
    driven.until_samples(500);
    assert_eq!(*driven.imu.link(), Link::Streaming);
}

#[test]
fn silence_is_noticed_and_its_end_too() {
    let drive = Drive::new();
    for (source, protocol) in BOTH {
        let begin = Instant::now();
        let _emulated = drive.serial(protocol, &["silence@3+3"]);
        let mut driven = Driven::new(&drive.config(source));
        driven.until_samples(1);
        driven.until_text("no sample for over 0.5 s");
        let noticed = begin.elapsed().as_secs_f64();
        driven.until("back", |driven| driven.imu.link().streams());
        let back = begin.elapsed().as_secs_f64();
        println!("{source:?}: noticed after {noticed:.2} s, back after {back:.2} s");
        assert!(noticed > 3.4, "{noticed}");
        assert!(
            (6.0..6.0 + BACK_MAX.as_secs_f64()).contains(&back),
            "{back}"
        );
        assert!(driven.count("reconnects") >= 1);
    }
}

const FAULTS: [(&str, &str, u64); 10] = [
    ("junk", "junk_bytes", 100),
    ("checksum", "checksum_errors", 10),
    ("cut", "junk_bytes", 100),
    ("oversize", "junk_bytes", 40),
    ("lost", "samples_lost", 8),
    ("doubled", "samples_doubled", 8),
    ("clock-reset", "clock_resets", 1),
    ("split", "samples", 100),
    ("close", "reconnects", 1),
    ("unplug", "reconnects", 1),
];

#[test]
fn every_fault_is_counted_and_over_when_it_is_over() {
    std::thread::scope(|scope| {
        for (source, protocol) in BOTH {
            for (fault, counter, least) in FAULTS {
                scope.spawn(move || survives(source, protocol, fault, counter, least));
            }
        }
    });
}

fn survives(source: ImuSource, protocol: SerialProtocol, fault: &str, counter: &str, least: u64) {
    let drive = Drive::new();
    let begin = Instant::now();
    let _emulated = drive.serial(protocol, &[&format!("{fault}@1.5+1")]);
    let mut driven = Driven::new(&drive.config(source));
    driven.until(fault, |driven| driven.count(counter) >= least);
    // The fault is over, the device is back, and all is steady.
    let over = Duration::from_millis(2500);
    driven.go_on(over.saturating_sub(begin.elapsed()));
    driven.until("back", |driven| driven.imu.link().streams());
    let back = begin.elapsed().saturating_sub(over);
    assert!(back < BACK_MAX, "{source:?}, {fault}: back after {back:?}");
    driven.go_on(SETTLED);
    let wrong = |driven: &Driven| -> Vec<(&str, u64)> {
        let good = ["samples", "frames", "junk_bytes"];
        let counters = driven.imu.counters().into_iter();
        let wrong = counters.filter(|count| !good.contains(&count.name));
        wrong.map(|count| (count.name, count.value)).collect()
    };
    let before = wrong(&driven);
    driven.until_samples(250);
    assert_eq!(wrong(&driven), before, "{source:?}, {fault}");
    assert_eq!(*driven.imu.link(), Link::Streaming, "{source:?}, {fault}");
    for pair in driven.samples.windows(2) {
        assert!(pair[1].header.stamp_ns > pair[0].header.stamp_ns, "{fault}");
    }
}

#[test]
fn a_wrong_rate_is_reported() {
    let drive = Drive::new();
    let _emulated = drive.serial(SerialProtocol::Mip, &["rate@0+100"]);
    Driven::new(&drive.config(ImuSource::Mip))
        .until_text("125 samples a second come instead of 250");
}

#[test]
fn gravity_that_points_down_is_reported() {
    let drive = Drive::new();
    let _emulated = drive.serial(SerialProtocol::Mip, &[]);
    let mut config = drive.config(ImuSource::Mip);
    config.imu.acceleration_axes = "-x -y -z".to_owned();
    let mut driven = Driven::new(&config);
    driven.until_text("upside down: up is -z of the robot; set imu.acceleration_axes");
    assert!(driven.imu.link().streams());
    assert_eq!(driven.imu.is_upright(), Some(false));
}

#[test]
fn a_fast_clock_is_known_and_does_not_pull_the_stamps_away() {
    let drive = Drive::new();
    let _emulated = drive.serial(SerialProtocol::Mip, &["skew@0+100"]);
    let mut driven = Driven::new(&drive.config(ImuSource::Mip));
    driven.until("skew", |driven| {
        (driven.imu.skew() - 200e-6).abs() < 50e-6 && driven.samples.len() > 2500
    });
    assert_eq!(driven.count("clock_resets"), 0);
    let last = driven.samples.last().unwrap();
    let late_ns = last.arrival_ns - last.header.stamp_ns;
    // As old as the last sample is late: milliseconds, on a busy machine more.
    println!("the last stamp is {late_ns} ns old");
    assert!(late_ns.abs() < 500_000_000, "{late_ns}");
}

#[test]
fn a_port_that_another_program_has_is_reported() {
    let drive = Drive::new();
    let _emulated = drive.serial(SerialProtocol::Mip, &[]);
    let config = drive.config(ImuSource::Mip);
    let mut first = Driven::new(&config);
    first.until_samples(10);
    let mut second = Driven::new(&config);
    second.until_text("another program has it open");
    drop(first);
    second.until_samples(500);
    assert_eq!(*second.imu.link(), Link::Streaming);
}

/// Answers that are not the device's own, while it is silent at first: seeds of
/// tests/wrong_packets.rs with which the setup ended before the device spoke, and the port had to
/// be opened again 1.5 s after the last wrong measurement.
#[test]
fn wrong_answers_before_the_device_speaks_do_not_end_its_setup() {
    std::thread::scope(|scope| {
        for seed in [41, 58, 69, 177] {
            scope.spawn(move || {
                let drive = Drive::new();
                let begin = Instant::now();
                let faults = ["silence@0+1.2", "wrong@0+2.0"];
                let _emulated = drive.serial_seeded(SerialProtocol::Xsens, &faults, seed);
                let mut driven = Driven::new(&drive.config(ImuSource::Xsens));
                driven.go_on(Duration::from_secs(2).saturating_sub(begin.elapsed()));
                driven.until_samples(500);
                println!("seed {seed}: 500 samples after {:?}", begin.elapsed());
                assert_eq!(driven.count("reconnects"), 0, "seed {seed}");
            });
        }
    });
}
