//! Sensors that lie: how much of a drive is believed, and how wrong that part is.

use clap::ValueEnum;
use indicatif::ProgressBar;
use randt::{drive::Drive, job, trust_spans};
use randt_config::{Config, Selection};
use randt_evaluation::{SilentlyWrong, silently_wrong};
use randt_lab::faults::{Fault, FaultInjector};
use randt_simulator::World;

/// What a drive reports under a fault, as a row.
fn judged(drive: &Drive, fault: Fault) -> SilentlyWrong {
    let mut source = FaultInjector::new(drive.source(), fault.injection(1));
    let loaded = Config::load(&Selection::default()).unwrap();
    let mut config = job::with_mounting(loaded, &source).config;
    config.loops.enabled = false;
    let done = job::run(&mut source, &config, true, &ProgressBar::hidden()).unwrap();
    let spans = trust_spans::from_states(&done.results.states);
    let trust = trust_spans::for_evaluation(&spans);
    let results = &done.results;
    let found = silently_wrong(&results.odometry(), results.truth(), &trust);
    println!(
        "{fault}: {:.1} % good, silent {} of {} m wrong of {}, worst 10 s of good ones {:.2} m",
        100.0 * found.good_share.unwrap(),
        found.silent_m,
        found.wrong_m,
        found.windows,
        found.worst_good_10s_m
    );
    found
}

#[test]
fn turned_and_mirrored_sensors_are_not_believed() {
    let drive = Drive::new(&World::building(), 300, 1, &ProgressBar::hidden()).unwrap();
    let share = |fault| judged(&drive, fault).good_share.unwrap();
    assert!(share(Fault::None) > 0.99);
    assert!(share(Fault::ImuUpsideDown) < 0.6);
    assert!(share(Fault::YawSign) < 0.6);
    assert!(share(Fault::RadarMirrored) < 0.6);
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
