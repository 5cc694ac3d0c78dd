//! A running ROS gives what its bag gives.

use super::bags::scans;
use super::support::*;
use crate::counters::Counters;
use crate::ros::{Encoding, Recording};
use crate::{Event, LiveRos, Options, ros1};

const RADAR: &str = "/radar_2/spectrum/pcl2";

/// Topic, type, arrival and bytes.
type Message = (String, String, i64, Vec<u8>);

/// The messages of a bag; static transforms first.
fn messages() -> Option<Vec<Message>> {
    let mut bag = ros1::Bag::open(&data("bags/room.bag")?).unwrap();
    let channels = bag.channels().to_vec();
    let transforms = bag.static_transforms().iter();
    let type_name = "tf2_msgs/TFMessage".to_owned();
    let transform =
        |bytes: &Vec<u8>| ("/tf_static".to_owned(), type_name.clone(), 0, bytes.clone());
    let mut messages: Vec<_> = transforms.map(transform).collect();
    let mut counters = Counters::default();
    while let Some(raw) = bag.next_message(&mut counters).unwrap() {
        let channel = &channels[raw.channel];
        let (topic, type_name) = (channel.topic.clone(), channel.type_name.clone());
        messages.push((topic, type_name, raw.arrival_ns, raw.bytes.to_vec()));
    }
    Some(messages)
}

fn options() -> Options {
    Options {
        radar_topic: Some(RADAR.to_owned()),
        imu_topic: Some("/imu/data".to_owned()),
        ..Options::default()
    }
}

fn samples(events: &[Event]) -> Vec<(i64, [f32; 3])> {
    let samples = events.iter().filter_map(|event| match event {
        Event::Imu(sample) => Some((
            sample.header.stamp_ns,
            sample.rate_rad_s.map(|rate| rate as f32),
        )),
        _ => None,
    });
    samples.collect()
}

#[test]
fn what_comes_live_is_what_the_bag_has() {
    let Some(messages) = messages() else {
        return;
    };
    let (bagged, _) = read_all(&data("bags/room.bag").unwrap());
    let mut live = LiveRos::new(Encoding::Ros1, options());
    let (mut events, mut before_first) = (Vec::new(), None);
    for (count, (topic, type_name, arrival_ns, bytes)) in messages.into_iter().enumerate() {
        live.push(&topic, &type_name, arrival_ns, bytes);
        while let Some(event) = live.next_event().unwrap() {
            before_first.get_or_insert(count);
            events.push(event);
        }
    }
    // Eight sweeps are learned from, with fifty samples each.
    assert!(before_first.unwrap() < 8 * 51 + 5, "{before_first:?}");
    let (bagged_scans, scans) = (scans(&bagged), scans(&events));
    assert_eq!(scans.len(), bagged_scans.len());
    for (scan, bagged) in scans.iter().zip(bagged_scans) {
        assert!(scan.items == bagged.items && scan.head == bagged.head);
    }
    assert_eq!(samples(&events), samples(&bagged));
    assert!(live.extrinsics().unwrap().imu.is_some());
    assert_eq!(
        live.counters()
            .iter()
            .filter(|counter| counter.loss)
            .count(),
        0
    );
}

#[test]
fn a_topic_that_comes_later_is_learned_and_others_are_left_out() {
    let Some(messages) = messages() else {
        return;
    };
    let mut live = LiveRos::new(Encoding::Ros1, options());
    let mut events = Vec::new();
    for (count, (topic, type_name, arrival_ns, bytes)) in messages.into_iter().enumerate() {
        live.push(
            "/camera",
            "sensor_msgs/CompressedImage",
            arrival_ns,
            vec![1, 2, 3],
        );
        // The IMU is plugged in after twenty sweeps.
        if topic == RADAR || count > 1_000 {
            live.push(&topic, &type_name, arrival_ns, bytes);
        }
        while let Some(event) = live.next_event().unwrap() {
            events.push(event);
        }
    }
    // None is missing.
    assert_eq!(scans(&events).len(), 200);
    assert!(samples(&events).len() > 8_900);
}

#[test]
fn what_cannot_be_decoded_is_counted() {
    let mut live = LiveRos::new(Encoding::Ros1, options());
    for stamp_ns in 0..20 {
        live.push(RADAR, "sensor_msgs/PointCloud2", stamp_ns, vec![7; 40]);
        assert!(live.next_event().unwrap().is_none());
    }
    live.push("/tf_static", "tf2_msgs/TFMessage", 0, vec![255; 9]);
    // What is named for a radar and is none.
    live.push(RADAR, "sensor_msgs/CompressedImage", 0, vec![1; 9]);
    let counters = live.counters();
    let count = |name: &str| counters.iter().find(|it| it.name == name).unwrap().count;
    assert!(count("sweeps_malformed") >= 8);
    assert_eq!(count("transforms_malformed"), 1);
    assert_eq!(count("messages_of_another_type"), 1);
}
