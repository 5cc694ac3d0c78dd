//! Sensors that lie: how much of a drive is believed, and how wrong that part is.

use clap::ValueEnum;
use indicatif::ProgressBar;
use randt::{drive::Drive, job, trust_spans};
use randt_config::{Config, Selection};
use randt_evaluation::{SilentlyWrong, silently_wrong};
use randt_lab::faults::{Fault, FaultInjector};
use randt_odometry::Counters;
use randt_simulator::World;

/// What a drive reports under a fault, as a row, and what it says of the IMU.
fn judged(drive: &Drive, fault: Fault) -> (SilentlyWrong, Counters) {
    let mut source = FaultInjector::new(drive.source(), fault.injection(1));
    let loaded = Config::load(&Selection::default()).unwrap();
    let mut config = job::with_mounting(loaded, &source).config;
    config.loops.enabled = false;
    let done = job::run(&mut source, &config, true, &ProgressBar::hidden()).unwrap();
    let spans = trust_spans::from_states(&done.results.states);
    let trust = trust_spans::for_evaluation(&spans);
    let results = &done.results;
    let found = silently_wrong(&results.odometry(), results.truth(), &trust);
    let counters = done.pipeline.counters();
    println!(
        "{fault}: {:.1} % good, silent {} of {} m wrong of {}, worst 10 s of good ones {:.2} m; {}, {} ms late, {} spikes",
        100.0 * found.good_share.unwrap(),
        found.silent_m,
        found.wrong_m,
        found.windows,
        found.worst_good_10s_m,
        counters.gyro_fault,
        counters.gyro_late_ms,
        counters.gyro_spikes,
    );
    (found, counters)
}

#[test]
fn a_gyro_that_lies_is_named_and_not_believed() {
    // Long enough that what a first estimate of a clock that stepped is off by (45 ms) shows again.
    let drive = Drive::new(&World::building(), 650, 1, &ProgressBar::hidden()).unwrap();
    let (clean, counters) = judged(&drive, Fault::None);
    assert!(clean.good_share.unwrap() > 0.99 && !counters.has_imu_fault());
    // The radar is right, and good by itself.
    for (fault, words, good_min) in [
        (Fault::ImuUpsideDown, "upside down", 0.98),
        (Fault::GyroDegrees, "degrees instead of radians", 0.8),
        (Fault::GyroSaturated, "end at 0.350 rad/s", 0.9),
        (Fault::GyroFrozen, "repeats", 0.9),
        (Fault::BiasStep, "bias", 0.9),
    ] {
        let (found, counters) = judged(&drive, fault);
        let text = counters.imu_text();
        assert!(text.contains(words), "{fault}: {text}");
        assert!(
            found.silent_m == 0 && found.good_share.unwrap() > good_min,
            "{fault}"
        );
    }
    // Followed, and said.
    let (found, counters) = judged(&drive, Fault::BiasCreep);
    assert!(counters.has_imu_fault() && found.silent_m == 0);
    assert!(
        counters.imu_text().contains("bias"),
        "{}",
        counters.imu_text()
    );
    // Either may be.
    for fault in [Fault::YawSign, Fault::RadarMirrored] {
        let (found, counters) = judged(&drive, fault);
        assert!(counters.imu_text().contains("opposite ways"), "{fault}");
        assert!(found.good_share.unwrap() < 0.1, "{fault}");
    }
    // Stamps that are wrong are set right, also where they become so.
    for (fault, late_ms) in [(Fault::ImuLate, 50), (Fault::ClockStep, 300)] {
        let (found, counters) = judged(&drive, fault);
        let text = counters.imu_text();
        assert!(text.contains("odometry.radar_late_s"), "{fault}: {text}");
        let found_ms = counters.gyro_late_ms;
        assert!((found_ms - late_ms).abs() < 30, "{fault}: {found_ms} ms");
        assert!(found.silent_m == 0, "{fault}");
    }
    let (found, counters) = judged(&drive, Fault::NoGravity);
    assert!(
        counters.imu_text().contains("no gravity (0."),
        "{}",
        counters.imu_text()
    );
    assert_eq!((found.silent_m, counters.scans_gyro_refused), (0, 0));
    // Harmless once the spikes are gone.
    let (found, counters) = judged(&drive, Fault::GyroSpikes);
    assert!(counters.gyro_spikes > 30 && !counters.has_imu_fault());
    assert_eq!(found.good_share, clean.good_share);
}

#[test]
#[ignore = "a table, a minute: cargo test --test programs lying:: -- --ignored --nocapture"]
fn what_is_believed_of_sensors_that_lie() {
    let drive = Drive::new(&World::building(), 1600, 1, &ProgressBar::hidden()).unwrap();
    for fault in Fault::value_variants() {
        if !fault.has_own_drive() {
            judged(&drive, *fault);
        }
    }
}
