//! A new reader gets what was sent before, at once, though nothing more is sent.

use crate::support::{Other, pipeline_folder};
use randt_messages::{ImuSample, ImuSampleTopic, MessageRef};
use randt_stage::{Domain, Stage, WakeReason};
use std::path::Path;
use std::time::Duration;

fn domain(run: &Path) -> Domain {
    Domain::new("history", Some(run)).unwrap()
}

/// What the other process does: it sends three samples, and then nothing more.
#[test]
fn writer() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    let mut stage = Stage::open("writer", &domain(&run)).unwrap();
    let mut samples = stage.publisher::<ImuSampleTopic>().unwrap();
    stage.running().unwrap();
    for device_ns in 0..3 {
        let head = &ImuSample {
            device_ns,
            ..ImuSample::default()
        };
        samples.publish(MessageRef { head, items: &[] }).unwrap();
    }
    println!("ready");
    while stage.wait(&[], None).unwrap() != WakeReason::Stop {}
    stage.close().unwrap();
}

#[test]
fn a_late_reader_is_woken_by_what_was_sent_before() {
    let run = tempfile::tempdir().unwrap();
    let other = Other::start("history::writer", run.path());
    let mut stage = Stage::open("reader", &domain(run.path())).unwrap();
    let mut samples = stage.subscriber::<ImuSampleTopic>().unwrap();
    stage.running().unwrap();
    let mut got = Vec::new();
    while got.len() < 3 {
        let woken = stage.wait(&[&samples], Some(Duration::from_secs(5)));
        assert_eq!(woken.unwrap(), WakeReason::Event, "slept over {got:?}");
        while let Some(sample) = samples.receive().unwrap() {
            got.push(sample.message().head.device_ns);
        }
    }
    assert_eq!(got, [0, 1, 2]);
    other.stop();
}
