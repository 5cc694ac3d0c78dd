//! Bags: the same sweeps from every form of the same messages.

use super::support::*;
use crate::counters::Counters;
use crate::ros::{Cloud, Encoding, Kind, RadarKind, Recording};
use crate::{Error, Event, Options, open, ros1};
use std::path::Path;

pub(super) const HALF_TURN: f64 = std::f64::consts::PI;

pub(super) fn scans(events: &[Event]) -> Vec<&randt_messages::Message<randt_messages::RadarScan>> {
    let scans = events.iter().filter_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    scans.collect()
}

#[test]
fn room_bag_is_as_its_description_has_it() {
    let Some(path) = data("bags/room.bag") else {
        return;
    };
    let (events, source) = read_all(&path);
    let info = source.info();
    assert_eq!((info.format, info.scans), ("ros1-bag", Some(200)));
    assert_eq!(info.sensor, randt_messages::SensorKind::IsdrC);
    assert!(
        info.extrinsics
            .radar
            .is_some_and(|p| p.to_array() == [0.0, 0.0, 0.0])
    );
    assert!(info.extrinsics.imu.is_some());
    let losses: Vec<_> = source.counters().into_iter().filter(|c| c.loss).collect();
    assert!(losses.is_empty(), "{losses:?}");

    let scans = scans(&events);
    assert_eq!((scans.len(), events.len()), (200, 10_200));
    for (index, scan) in scans.iter().enumerate() {
        let sweep = &scan.head.sweep;
        assert_eq!(scan.head.header.sequence, index as u64);
        assert_eq!(sweep.end_ns - sweep.begin_ns, 200_000_000);
        assert_eq!(
            sweep.end_ns,
            1_700_000_000_200_000_000 + 200_000_000 * index as i64
        );
        assert_eq!(sweep.beam_count, 220);
        let step = 2.0 * HALF_TURN / 220.0;
        assert!((f64::from(sweep.azimuth_step_rad) - step).abs() < 1e-8);
        assert!((f64::from(sweep.range_resolution_m) - 0.0161).abs() < 1e-6);
        assert!((8_000..12_000).contains(&scan.items.len()));
        for (number, beam) in sweep.beams().iter().enumerate() {
            let azimuth = -HALF_TURN + number as f64 * step;
            assert!(
                (f64::from(beam.azimuth_rad) - azimuth).abs() < 1e-6,
                "{beam:?}"
            );
            let since_begin_ns = beam.stamp_ns - sweep.begin_ns;
            assert_eq!(
                since_begin_ns,
                ((2 * number as i64 + 1) * 200_000_000 + 220) / 440
            );
            let returns = &scan.items[sweep.returns_of(number, scan.items.len())];
            assert!(returns.iter().all(|r| usize::from(r.beam) == number));
            assert!(returns.is_sorted_by(|a, b| a.range_m < b.range_m && a.bin < b.bin));
            assert!(
                returns
                    .iter()
                    .all(|r| (r.range_m - f32::from(r.bin) * 0.0161).abs() < 1e-4)
            );
        }
    }
    assert!(events.is_sorted_by_key(Event::stamp_ns));
}

/// The messages of a bag, its clouds laid out anew.
fn rewritten(path: &Path, layout: &CloudLayout, style: Style, limit: usize) -> Vec<TestMessage> {
    let mut bag = ros1::Bag::open(path).unwrap();
    let channels = bag.channels().to_vec();
    let mut counters = Counters::default();
    let mut messages = Vec::new();
    while messages.len() < limit {
        let Some(raw) = bag.next_message(&mut counters).unwrap() else {
            break;
        };
        let (arrival_ns, bytes) = (raw.arrival_ns, raw.bytes);
        let (topic, type_name, bytes) = match channels[raw.channel].kind {
            Kind::Radar(RadarKind::Cloud) => {
                let cloud = Cloud::decode(bytes, Encoding::Ros1, None).unwrap();
                let points = cloud
                    .points
                    .iter()
                    .map(|p| (p.x_m, p.y_m, f64::from(p.intensity)));
                let cloud = TestCloud {
                    stamp_ns: cloud.header.stamp_ns,
                    points: points.collect(),
                };
                (
                    "/radar_2/spectrum/pcl2",
                    CLOUD,
                    cloud.serialise(style, layout),
                )
            }
            Kind::StaticTransforms => {
                let mounts = [
                    (
                        "base_link",
                        "left_radar_link",
                        [0.0, 0.0, 0.4],
                        [0.0, 0.0, 0.0, 1.0],
                    ),
                    (
                        "base_link",
                        "imu_link",
                        [0.0, 0.0, 0.1],
                        [0.0, 0.0, 0.0, 1.0],
                    ),
                ];
                ("/tf_static", TF, transforms(style, &mounts))
            }
            Kind::Imu => {
                let sample = crate::ros::imu::RosImu::decode(bytes, Encoding::Ros1).unwrap();
                (
                    "/imu/data",
                    IMU,
                    imu(
                        style,
                        sample.header.stamp_ns,
                        sample.rate_rad_s,
                        sample.acceleration_m_s2,
                    ),
                )
            }
            other => panic!("{other:?}"),
        };
        messages.push(TestMessage {
            topic,
            type_name,
            arrival_ns,
            bytes,
        });
    }
    messages
}

/// Steps of 32 with padding between rows, big-endian, fields out of order.
const WIDE: CloudLayout = CloudLayout {
    point_step: 32,
    offsets: [16, 24, 4, 8],
    big_endian: true,
    datatype: 7,
    row_padding: 5,
    rows: 1,
    intensity_name: "power",
    values: 1,
};
const DOUBLE: CloudLayout = CloudLayout {
    point_step: 40,
    offsets: [8, 16, 0, 32],
    datatype: 8,
    big_endian: false,
    ..WIDE
};

#[test]
fn the_same_messages_in_another_layout_give_the_same_bits() {
    let Some(path) = data("bags/room.bag") else {
        return;
    };
    // 20 sweeps with their IMU samples.
    let limit = 1021;
    let messages = rewritten(&path, &CloudLayout::AS_PUBLISHED, Style::Ros1, limit);
    let (_folder, as_published) = file("a.bag", &ros1_bag(&messages, "lz4", 300));
    let expected = fingerprint(&read_all(&as_published).0);
    let whole = fingerprint(&read_all(&path).0);
    assert_eq!(
        expected[..1000],
        whole[..1000],
        "the copy differs from its original"
    );
    for (layout, compression, per_chunk) in [
        (&WIDE, "none", 1),
        (&DOUBLE, "bz2", 77),
        (&WIDE, "lz4", 5000),
    ] {
        let messages = rewritten(&path, layout, Style::Ros1, limit);
        let (_folder, other) = file("b.bag", &ros1_bag(&messages, compression, per_chunk));
        let events = read_all(&other).0;
        assert!(fingerprint(&events) == expected, "{layout:?} {compression}");
    }
}

#[test]
fn ros_2_bags_give_the_same_bits_as_ros_1() {
    let layout = CloudLayout::AS_PUBLISHED;
    let (_folder, bag) = file(
        "a.bag",
        &ros1_bag(&recording(Style::Ros1, &layout, 12), "lz4", 100),
    );
    let (events, source) = read_all(&bag);
    let expected = fingerprint(&events);
    assert_eq!(expected.len(), 12 * 51);
    let extrinsics = source.info().extrinsics;
    assert_eq!(extrinsics.radar.unwrap().to_array(), [0.3, -0.1, 0.0]);
    assert_eq!(extrinsics.imu.unwrap().to_array(), [0.0, 1.0, 0.0, 0.0]);

    for (style, layout) in [(Style::CdrLittle, &layout), (Style::CdrBig, &WIDE)] {
        let messages = recording(style, layout, 12);
        let check = |path: &Path, format: &str| {
            let (events, source) = read_all(path);
            assert_eq!(
                (source.info().format, source.info().scans),
                (format, Some(12))
            );
            assert_eq!(source.info().extrinsics, extrinsics);
            assert!(fingerprint(&events) == expected, "{style:?} {format}");
            assert!(
                source.counters().iter().all(|c| !c.loss),
                "{:?}",
                source.counters()
            );
        };
        let (_folder, mcap) = file("a.mcap", &mcap_bag(&messages, 10_000));
        check(&mcap, "ros2-mcap");

        let folder = tempfile::tempdir().unwrap();
        let database = folder.path().join("anything");
        database_bag(&messages, &database);
        check(&database, "ros2-db3");

        // A folder of a split recording; the tenth part comes after the ninth.
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("metadata.yaml"),
            "rosbag2_bagfile_information:",
        )
        .unwrap();
        for (part, messages) in messages.chunks(51).enumerate() {
            database_bag(messages, &folder.path().join(format!("bag_{part}.db3")));
        }
        check(folder.path(), "ros2-db3");
    }
}

#[test]
fn fixtures_without_a_radar_are_refused() {
    let Some(bags) = data("bags") else { return };
    let error = |name: &str| open(&bags.join(name), &Options::default()).err().unwrap();
    let text = error("example-bz2.bag").to_string();
    assert!(
        text.contains("example-bz2.bag: no radar topic") && text.contains("/turtle1"),
        "{text}"
    );
    assert!(matches!(error("no-messages.bag"), Error::NoRadar { .. }));
    let text = error("empty-file.bag").to_string();
    assert!(
        text.contains("a file of 0 bytes") && text.contains("expected"),
        "{text}"
    );
    let anything = Options {
        radar_required: false,
        ..Options::default()
    };
    let (events, source) = read_with(&bags.join("example-bz2.bag"), &anything);
    assert!(
        events.is_empty() && source.counters().is_empty(),
        "{:?}",
        source.counters()
    );
}

#[test]
fn an_imu_recording_is_read_without_a_radar() {
    let Some(path) = data("imu/phidgets_imu_upside_down.bag") else {
        return;
    };
    let options = Options {
        radar_required: false,
        ..Options::default()
    };
    let (events, source) = read_with(&path, &options);
    assert_eq!(events.len(), 13_964);
    assert!(matches!(&events[0], Event::Imu(s) if s.acceleration_m_s2[2] < -9.0));
    assert!(
        source.counters().iter().all(|c| !c.loss),
        "{:?}",
        source.counters()
    );
}

#[test]
fn topics_are_chosen_by_name_or_by_number_of_messages() {
    let style = Style::Ros1;
    let mut messages = recording(style, &CloudLayout::AS_PUBLISHED, 10);
    let second: Vec<TestMessage> = messages
        .iter()
        .filter(|m| m.type_name == CLOUD)
        .take(3)
        .map(|m| TestMessage {
            topic: "/other/points",
            ..m.clone()
        })
        .collect();
    messages.extend(second);
    let (_folder, path) = file("a.bag", &ros1_bag(&messages, "none", 50));
    let (events, source) = read_all(&path);
    assert_eq!(scans(&events).len(), 10);
    let chosen = source
        .counters()
        .into_iter()
        .find(|c| c.name == "radar_topic_chosen")
        .unwrap();
    assert!(
        chosen
            .first
            .starts_with("/radar/points of /radar/points (10), /other/points (3)")
    );

    let options = Options {
        radar_topic: Some("/other/points".into()),
        ..Options::default()
    };
    assert_eq!(scans(&read_with(&path, &options).0).len(), 3);
    let options = Options {
        radar_topic: Some("/imu/data".into()),
        ..Options::default()
    };
    let text = open(&path, &options).err().unwrap().to_string();
    assert!(
        text.contains("no topic /imu/data of type sensor_msgs/PointCloud2"),
        "{text}"
    );
}

#[test]
fn our_log_gives_what_was_written() {
    let messages = recording(Style::Ros1, &CloudLayout::AS_PUBLISHED, 10);
    let (_folder, bag) = file("a.bag", &ros1_bag(&messages, "lz4", 100));
    let (events, source) = read_all(&bag);
    let (_folder, log) = file("a.mcap", &log_of(&events, source.info()));
    let (again, of_log) = read_all(&log);
    assert_eq!(fingerprint(&again), fingerprint(&events));
    assert_eq!(of_log.info().extrinsics, source.info().extrinsics);
    assert_eq!(
        (of_log.info().format, of_log.info().scans),
        ("randt-log", Some(10))
    );
}
