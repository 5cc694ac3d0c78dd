//! Bags: the same sweeps from every form of the same messages.

use super::support::*;
use crate::ros::{Cloud, Encoding, Kind, Recording};
use crate::tally::Tally;
use crate::{Error, Event, Options, open, ros1};
use std::path::Path;

const HALF_TURN: f64 = std::f64::consts::PI;

fn scans(events: &[Event]) -> Vec<&randt_messages::Message<randt_messages::RadarScan>> {
    let scans = events.iter().filter_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    scans.collect()
}

#[test]
fn room_bag_is_as_its_description_says() {
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
            let place = beam.stamp_ns - sweep.begin_ns;
            assert_eq!(place, ((2 * number as i64 + 1) * 200_000_000 + 220) / 440);
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
    let mut tally = Tally::default();
    let mut messages = Vec::new();
    while messages.len() < limit {
        let Some(raw) = bag.next_message(&mut tally).unwrap() else {
            break;
        };
        let (arrival_ns, bytes) = (raw.arrival_ns, raw.bytes);
        let (topic, type_name, bytes) = match channels[raw.channel].kind {
            Kind::Cloud => {
                let cloud = Cloud::decode(bytes, Encoding::Ros1).unwrap();
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
fn fixtures_without_a_radar_say_so() {
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

/// A recording whose transforms are these, on these topics.
fn mounted(topics: &[(&'static str, &[TestTransform])]) -> Vec<u8> {
    let mut messages = recording(Style::Ros1, &CloudLayout::AS_PUBLISHED, 9);
    messages.remove(0);
    for (place, (topic, content)) in topics.iter().enumerate() {
        let bytes = transforms(Style::Ros1, content);
        let arrival_ns = messages[place].arrival_ns;
        messages.insert(
            place,
            TestMessage {
                topic,
                type_name: TF,
                arrival_ns,
                bytes,
            },
        );
    }
    ros1_bag(&messages, "none", 100)
}

#[test]
fn the_mounting_is_found_through_chains_of_static_transforms() {
    let level = [0.0, 0.0, 0.0, 1.0];
    let quarter = [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()];
    let chain: [TestTransform; 3] = [
        ("/base_link", "mast", [1.0, 0.0, 0.0], quarter),
        ("mast", "/left_radar_link", [0.5, 0.0, 0.0], level),
        ("mast", "imu_link", [0.0; 3], level),
    ];
    // In /tf among moving ones, and in /tf_static.
    let moving = [("odom", "base_link", [1.0, 0.0, 0.0], level)];
    let moved = [("odom", "base_link", [2.0, 0.0, 0.0], level)];
    for topic in ["/tf", "/tf_static"] {
        let (_folder, path) = file(
            "a.bag",
            &mounted(&[("/tf", &moving), (topic, &chain), ("/tf", &moved)]),
        );
        let (_, source) = read_all(&path);
        let extrinsics = source.info().extrinsics;
        let [x, y, yaw] = extrinsics.radar.unwrap().to_array();
        assert!(
            (x - 1.0).abs() < 1e-12
                && (y - 0.5).abs() < 1e-12
                && (yaw - HALF_TURN / 2.0).abs() < 1e-12
        );
        assert!((extrinsics.imu.unwrap().z - 0.5_f64.sqrt()).abs() < 1e-12);
        assert!(source.counters().is_empty(), "{:?}", source.counters());
    }
    // A mast that moves is no mounting; no transform at all neither.
    let turned: [TestTransform; 1] = [("base_link", "mast", [1.0, 0.0, 0.0], level)];
    for bytes in [mounted(&[("/tf", &chain), ("/tf", &turned)]), mounted(&[])] {
        let (_folder, path) = file("a.bag", &bytes);
        let (_, source) = read_all(&path);
        assert_eq!(source.info().extrinsics, crate::Extrinsics::default());
        let names: Vec<_> = source
            .counters()
            .iter()
            .map(|c| (c.name, c.count, c.loss))
            .collect();
        assert_eq!(
            names,
            [
                ("radar_mounting_assumed", 1, false),
                ("imu_mounting_assumed", 1, false)
            ]
        );
    }
}

#[test]
fn a_radar_that_hangs_upside_down_is_turned() {
    let level: [TestTransform; 1] = [(
        "base_link",
        "left_radar_link",
        [0.0; 3],
        [0.0, 0.0, 0.0, 1.0],
    )];
    // Half a turn about x: its y points to the right.
    let hanging: [TestTransform; 1] = [(
        "base_link",
        "left_radar_link",
        [0.0; 3],
        [1.0, 0.0, 0.0, 0.0],
    )];
    let read = |content: &[TestTransform]| {
        let (_folder, path) = file("a.bag", &mounted(&[("/tf_static", content)]));
        let (events, source) = read_all(&path);
        assert_eq!(source.info().extrinsics.radar.unwrap().to_array(), [0.0; 3]);
        events
    };
    let (upright, hung) = (read(&level), read(&hanging));
    for (upright, hung) in scans(&upright).iter().zip(scans(&hung)) {
        let (upright, hung) = (&upright.head.sweep, &hung.head.sweep);
        assert_eq!(upright.beam_count, hung.beam_count);
        for (a, b) in upright.beams().iter().zip(hung.beams()).skip(1) {
            assert!((a.azimuth_rad + b.azimuth_rad).abs() < 1e-6 && a.stamp_ns == b.stamp_ns);
        }
    }
}

#[test]
fn messages_without_a_stamp_are_stamped_on_arrival() {
    let layout = CloudLayout::AS_PUBLISHED;
    let mut messages = recording(Style::Ros1, &layout, 9);
    let mut random = Random(1);
    for message in messages.iter_mut().filter(|m| m.type_name == CLOUD) {
        message.bytes = cloud(0, &mut random).serialise(Style::Ros1, &layout);
    }
    let (_folder, path) = file("a.bag", &ros1_bag(&messages, "none", 100));
    let (events, source) = read_all(&path);
    let stamps: Vec<i64> = scans(&events)
        .iter()
        .map(|scan| scan.head.header.stamp_ns)
        .collect();
    assert_eq!(stamps[0], 1_700_000_000_200_003_000);
    assert_eq!(
        (source.counters()[0].name, source.counters()[0].count),
        ("stamps_taken_from_arrival", 9)
    );
}

#[test]
fn a_part_of_a_split_bag_that_cannot_be_read_is_counted() {
    let messages = recording(Style::CdrLittle, &CloudLayout::AS_PUBLISHED, 12);
    let folder = tempfile::tempdir().unwrap();
    for (part, messages) in messages.chunks(205).enumerate() {
        std::fs::write(
            folder.path().join(format!("bag_{part}.mcap")),
            mcap_bag(messages, 40_000),
        )
        .unwrap();
    }
    std::fs::write(folder.path().join("bag_1.mcap"), b"").unwrap();
    let (events, source) = read_all(folder.path());
    assert_eq!(scans(&events).len(), 8);
    let counters = source.counters();
    let missing = counters
        .iter()
        .find(|c| c.name == "bag_parts_unreadable")
        .unwrap();
    assert!(
        missing.loss && missing.first.contains("bag_1.mcap: a file of 0 bytes"),
        "{missing:?}"
    );
}

#[test]
fn a_stamp_before_1970_is_left_out() {
    let layout = CloudLayout::AS_PUBLISHED;
    let mut messages = recording(Style::CdrLittle, &layout, 9);
    // ROS 2 has signed seconds.
    let sample = imu(
        Style::CdrLittle,
        0xf000_0000_i64 * 1_000_000_000,
        [0.0; 3],
        [0.0; 3],
    );
    messages[5].bytes = sample;
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let (events, source) = read_all(&path);
    assert_eq!(events.len(), 9 * 51 - 1);
    let counters = source.counters();
    assert_eq!(
        (counters[0].name, counters[0].count),
        ("stamps_out_of_range", 1)
    );
}
