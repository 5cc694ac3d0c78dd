//! Bags: mounting, stamps, and files that are missing.

use super::bags::{HALF_TURN, scans};
use super::support::*;

/// A recording whose transforms are these, on these topics.
fn mounted(topics: &[(&'static str, &[TestTransform])]) -> Vec<u8> {
    let mut messages = recording(Style::Ros1, &CloudLayout::AS_PUBLISHED, 9);
    messages.remove(0);
    for (index, (topic, content)) in topics.iter().enumerate() {
        let bytes = transforms(Style::Ros1, content);
        let arrival_ns = messages[index].arrival_ns;
        messages.insert(
            index,
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
    // One that is not there at all, by what the recorder wrote of its files.
    std::fs::remove_file(folder.path().join("bag_1.mcap")).unwrap();
    assert!(read_all(folder.path()).1.counters().is_empty());
    let list = "info:\n  files: 3\n  relative_file_paths:\n  - bag_0.mcap\n  - bag_1.mcap\n  - bag_2.mcap\n  ros_distro: x\n";
    std::fs::write(folder.path().join("metadata.yaml"), list).unwrap();
    let counters = read_all(folder.path()).1.counters();
    let [missing] = counters.as_slice() else {
        panic!("{counters:?}");
    };
    assert!(
        missing.loss
            && missing
                .first
                .ends_with("names bag_1.mcap, which is not there")
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
