//! A log that is played through the processes as fast as it was recorded gives the bits of `randt
//! run`.

use crate::support::phidgets::{OFF_NS, restamp};
use crate::support::pipeline::Pipeline;
use crate::support::up::{PATIENT, up};
use crate::support::{ended_within, l_shaped_world, report, run, tum};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// The drive takes 90 s; starting and ending some more, on a slow machine much more.
const TIME_MAX: Duration = Duration::from_secs(300);
/// What must be the same. The picture and the report name times and counters of the processes.
const SAME: [&str; 6] = [
    "odometry.csv",
    "odometry.tum",
    "trajectory.tum",
    "keyframes.tum",
    "map.pgm",
    "map.yaml",
];

/// The stamps are what this test is about.
fn assert_like_phidgets(stamps: &[i64], sweep_ends: &[i64]) {
    let mut intervals: Vec<i64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_unstable();
    let at = |share: f64| intervals[(intervals.len() as f64 * share) as usize] as f64 * 1e-6;
    let (median, p99, p999) = (at(0.5), at(0.99), at(0.999));
    println!("intervals of the IMU: median {median:.2} ms, 99 % {p99:.1} ms, 99.9 % {p999:.1} ms");
    assert!((median - 4.0).abs() < 0.05 && (4.8..6.8).contains(&p99) && p999 > 6.5);
    let mut after: Vec<i64> = sweep_ends
        .iter()
        .map(|end| stamps[stamps.partition_point(|stamp| stamp < end)] - end)
        .collect();
    after.sort_unstable();
    let median = after[after.len() / 2];
    assert!((median - OFF_NS).abs() < 200_000, "{median} ns");
}

fn assert_same(found: &Path, expected: &Path) {
    for name in SAME {
        let [found, expected] =
            [found, expected].map(|folder| fs::read(folder.join(name)).unwrap());
        let differs = found.iter().zip(&expected).position(|(a, b)| a != b);
        assert!(
            found == expected,
            "{name}: {} bytes instead of {}, first difference at byte {differs:?}",
            found.len(),
            expected.len()
        );
    }
}

#[test]
fn a_log_played_at_rate_1_gives_the_bits_of_randt_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let log = at("jittered.mcap");
    let stamps = restamp(&l_shaped_world::drive(folder.path()).0, &log, 11);

    let offline = run(&log, &at("run"), &PATIENT);
    assert_eq!(offline.code, Some(0), "{}", offline.stderr);
    let rows = tum(&at("run").join("odometry.tum"));
    // The log ends with its last sweep: no sample follows that one.
    let ends: Vec<i64> = rows.iter().map(|row| row.stamp_ns).collect();
    assert_like_phidgets(&stamps, &ends[..ends.len() - 1]);

    let own = Pipeline::new("bits");
    let live = ended_within(up(own.domain(), &log, &at("up")), TIME_MAX);
    // 3 would mean that something was dropped.
    assert_eq!(live.code, Some(0), "{}", live.stderr);
    let (offline, live) = (report(&at("run")), report(&at("up")));
    println!("{} scans, {} keyframes", live["scans"], live["keyframes"]);
    assert!(offline["loops"]["statuses"]["accepted"].as_u64().unwrap() > 0);
    // Not one counter more, such as messages_lost, states_missed or stage_restarts; and as many
    // scans that wait in vain for a sample of the IMU as offline.
    assert_eq!(live["counters"], offline["counters"]);
    assert_same(&at("up"), &at("run"));
    let left = randt_stage::wipe(own.domain(), false).unwrap();
    println!("{:?} entries left over", left.as_ref().map(Vec::len));
    assert!(left.is_some(), "the domain is still in use");
}
