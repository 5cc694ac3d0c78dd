//! A message that was filled in shared memory arrives as one that was copied there.

use crate::support::{Other, pipeline_folder};
use randt_messages::{RadarScan, Return};
use randt_stage::{Domain, Stage, WakeReason};
use std::path::Path;
use std::time::Duration;

fn domain(run: &Path) -> Domain {
    Domain::new("loan", Some(run)).unwrap()
}

fn returns() -> impl Iterator<Item = Return> {
    (0..1000).map(|bin| Return {
        range_m: f32::from(bin) * 0.1,
        intensity: 7.0,
        beam: 3,
        bin,
    })
}

#[test]
fn writer() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    let mut stage = Stage::open("writer", &domain(&run)).unwrap();
    let mut scans = stage.publisher::<RadarScan>().unwrap();
    stage.running().unwrap();
    // Filled and thrown away: neither sent nor numbered, and its memory is free again.
    for _ in 0..100 {
        let mut loan = scans.loan(5).unwrap();
        loan.head_mut().sweep.beam_count = 99;
        loan.items_mut()[0].bin = 99;
    }
    for count in [1000, 0, 1] {
        let mut loan = scans.loan(count).unwrap();
        assert_eq!(loan.head_mut().sweep.beam_count, 0);
        loan.head_mut().sweep.beam_count = 4;
        loan.head_mut().header.stamp_ns = 17;
        let items = loan.items_mut();
        assert_eq!(items.len(), count);
        for (item, value) in items.iter_mut().zip(returns()) {
            *item = value;
        }
        scans.publish_loan(loan).unwrap();
    }
    println!("ready");
    while stage.wait(&[], None).unwrap() != WakeReason::Stop {}
    stage.close().unwrap();
}

#[test]
fn what_is_filled_in_a_loan_arrives() {
    let run = tempfile::tempdir().unwrap();
    let other = Other::start("loan::writer", run.path());
    let mut stage = Stage::open("reader", &domain(run.path())).unwrap();
    let mut scans = stage.subscriber::<RadarScan>().unwrap();
    stage.running().unwrap();
    let mut got = Vec::new();
    while got.len() < 3 {
        let woken = stage.wait(&[&scans], Some(Duration::from_secs(5)));
        assert_eq!(woken.unwrap(), WakeReason::Event, "slept over {got:?}");
        while let Some(scan) = scans.receive().unwrap() {
            let scan = scan.message();
            assert_eq!(
                (scan.head.sweep.beam_count, scan.header().stamp_ns),
                (4, 17)
            );
            assert!(scan.header().published_ns > 0);
            assert!(
                scan.items
                    .iter()
                    .copied()
                    .eq(returns().take(scan.items.len()))
            );
            got.push((scan.header().sequence, scan.items.len()));
        }
    }
    assert_eq!(got, [(0, 1000), (1, 0), (2, 1)]);
    other.stop();
}
