//! Recordings as people have them: other names of fields, compressed messages, streams that stand
//! apart, files that overlap, stamps that are off.

use super::support::*;
use crate::{Error, Event, Options, Source, open};
use std::path::Path;

const LAYOUT: CloudLayout = CloudLayout::AS_PUBLISHED;

fn messages(sweeps: usize) -> Vec<TestMessage> {
    recording(Style::CdrLittle, &LAYOUT, sweeps)
}

/// What a plain MCAP of these messages gives.
fn plain(messages: &[TestMessage]) -> Vec<Vec<u8>> {
    let (_folder, path) = file("a.mcap", &mcap_bag(messages, 40_000));
    fingerprint(&read_all(&path).0)
}

/// Events without their arrival, and the counters that are losses.
fn read(path: &Path) -> (Vec<Vec<u8>>, Vec<&'static str>) {
    let (events, source) = read_all(path);
    let counters = source.counters().into_iter();
    let losses = counters.filter(|c| c.loss).map(|c| c.name).collect();
    (fingerprint(&events), losses)
}

fn count(source: &dyn Source, name: &str) -> u64 {
    let counters = source.counters();
    let found = counters.iter().find(|counter| counter.name == name);
    found.map_or(0, |counter| counter.count)
}

#[test]
fn the_intensity_is_found_by_its_role() {
    let with_name = |intensity_name| {
        let layout = CloudLayout {
            intensity_name,
            ..LAYOUT
        };
        file(
            "a.mcap",
            &mcap_bag(&recording(Style::CdrLittle, &layout, 9), 40_000),
        )
    };
    let expected = plain(&messages(9));
    for name in ["Intensity", "POWER", "reflectivity", "SNR"] {
        let (_folder, path) = with_name(name);
        assert!(fingerprint(&read_all(&path).0) == expected, "{name}");
    }
    let (_folder, path) = with_name("doppler");
    let (events, source) = read_all(&path);
    let fields = source.info().without_intensity.clone().unwrap();
    assert!(fields.contains("doppler"), "{fields}");
    assert_eq!(count(source.as_ref(), "returns_without_intensity"), 1);
    let is_strong = |event: &Event| match event {
        Event::Scan(scan) => scan.items.iter().all(|item| item.intensity > 65_535.0),
        _ => true,
    };
    assert!(events.len() == expected.len() && events.iter().all(is_strong));
    let named = |name: &str| Options {
        intensity_field: Some(name.to_owned()),
        ..Options::default()
    };
    assert!(fingerprint(&read_with(&path, &named("Doppler")).0) == expected);
    let Err(error) = open(&path, &named("power")) else {
        panic!("a field that is not there");
    };
    let text = error.to_string();
    assert!(
        text.contains("--intensity-field") && text.contains("doppler"),
        "{text}"
    );
}

#[test]
fn a_topic_that_can_be_decoded_is_taken() {
    let expected = plain(&messages(9));
    let mut with_objects = messages(9);
    let objects = CloudLayout {
        intensity_name: "id",
        ..LAYOUT
    };
    let mut random = Random(7);
    for end in 1..=20 {
        let stamp_ns = 1_700_000_000_000_000_000 + end * 90_000_000;
        with_objects.push(TestMessage {
            topic: "/objects",
            type_name: CLOUD,
            arrival_ns: stamp_ns,
            bytes: cloud(stamp_ns, &mut random).serialise(Style::CdrLittle, &objects),
        });
    }
    with_objects.sort_by_key(|message| message.arrival_ns);
    let (_folder, path) = file("a.mcap", &mcap_bag(&with_objects, 40_000));
    assert!(fingerprint(&read_all(&path).0) == expected);
    let radar = with_objects
        .iter_mut()
        .filter(|message| message.topic == "/radar/points");
    radar.for_each(|message| message.topic = "/tracks");
    with_objects
        .iter_mut()
        .for_each(|message| message.bytes.truncate(60));
    let (_folder, path) = file("a.mcap", &mcap_bag(&with_objects, 40_000));
    match open(&path, &Options::default()) {
        Err(error @ Error::NotDecoded { .. }) => {
            assert!(error.to_string().contains("--radar-topic"), "{error}");
        }
        other => panic!("{:?}", other.map(|_| ())),
    }
}

#[test]
fn streams_may_stand_anywhere_in_a_file() {
    let messages = messages(60);
    let expected = plain(&messages);
    let of = |topic: &str| -> Vec<TestMessage> {
        let of_topic = messages.iter().filter(|message| message.topic == topic);
        of_topic.cloned().collect()
    };
    let (imu, radar, tf) = (of("/imu/data"), of("/radar/points"), of("/tf_static"));
    let behind = [radar.clone(), tf.clone(), imu.clone()].concat();
    let before = [imu, tf, radar].concat();
    for (name, apart) in [("behind", behind), ("before", before)] {
        let (_folder, path) = file("a.mcap", &mcap_bag(&apart, 40_000));
        assert!(read(&path) == (expected.clone(), vec![]), "{name}, MCAP");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.db3");
        database_bag(&apart, &path);
        assert!(
            read(&path) == (expected.clone(), vec![]),
            "{name}, database"
        );
    }
}

#[test]
fn files_that_overlap_are_one_recording() {
    let messages = messages(30);
    let expected = plain(&messages);
    let middle_ns = 1_700_000_003_000_000_000;
    let overlap = |message: &TestMessage| (message.arrival_ns - middle_ns).abs() < 300_000_000;
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(3);
    let write = |name: &str, messages: Vec<TestMessage>| {
        std::fs::write(folder.path().join(name), mcap_bag(&messages, 40_000)).unwrap();
    };
    // Where they overlap, each message is in one of them, or in both.
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for message in &messages {
        let place = if overlap(message) { random.below(3) } else { 3 };
        let is_early = message.arrival_ns < middle_ns;
        if place == 0 || place == 2 || (place == 3 && is_early) {
            first.push(message.clone());
        }
        if place == 1 || place == 2 || (place == 3 && !is_early) {
            second.push(message.clone());
        }
    }
    write("drive_0.mcap", first);
    write("drive_1.mcap", second);
    assert!(read(folder.path()) == (expected.clone(), vec![]));
    // A file of each sensor, compressed as rosbag2 does it.
    let folder = tempfile::tempdir().unwrap();
    for (name, is_imu) in [("radar.mcap.zstd", false), ("imu.mcap.zstd", true)] {
        let of_sensor = messages
            .iter()
            .filter(|m| (m.topic == "/imu/data") == is_imu);
        let bytes = mcap_bag(&of_sensor.cloned().collect::<Vec<_>>(), 40_000);
        let packed = zstd::encode_all(bytes.as_slice(), 1).unwrap();
        std::fs::write(folder.path().join(name), packed).unwrap();
    }
    assert!(read(folder.path()) == (expected, vec![]));
}

#[test]
fn compressed_messages_are_decompressed_and_broken_ones_counted() {
    let mut messages = messages(9);
    let expected = plain(&messages);
    for message in &mut messages {
        message.bytes = zstd::encode_all(message.bytes.as_slice(), 1).unwrap();
    }
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    assert!(read(&path) == (expected, vec![]));
    let broken = messages
        .iter_mut()
        .rfind(|m| m.topic == "/imu/data")
        .unwrap();
    broken.bytes.truncate(20);
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let (_, source) = read_all(&path);
    assert_eq!(count(source.as_ref(), "messages_not_decompressed"), 1);
}

#[test]
fn channels_need_not_be_repeated_in_the_summary() {
    let messages = messages(9);
    let mut writer = mcap::WriteOptions::new()
        .chunk_size(Some(40_000))
        .repeat_channels(false)
        .repeat_schemas(false)
        .create(std::io::Cursor::new(Vec::new()))
        .unwrap();
    for message in &messages {
        let type_name = message.type_name.replace('/', "/msg/");
        let schema = writer.add_schema(&type_name, "ros2msg", b"").unwrap();
        let channel = writer.add_channel(schema, message.topic, "cdr", &Default::default());
        let header = mcap::records::MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 0,
            log_time: message.arrival_ns as u64,
            publish_time: message.arrival_ns as u64,
        };
        writer
            .write_to_known_channel(&header, &message.bytes)
            .unwrap();
    }
    writer.finish().unwrap();
    let (_folder, path) = file("a.mcap", &writer.into_inner().into_inner());
    assert!(read(&path) == (plain(&messages), vec![]));
}

#[test]
fn one_stamp_that_is_off_costs_its_message() {
    let day_ns = 86_400_000_000_000;
    let start_ns = 1_700_000_000_000_000_000;
    // Sweep, offset of its stamp, and of its time of recording.
    for (number, off_ns, arrival_ns) in [
        (5_i64, 400 * day_ns, 0),
        (12, -day_ns, 0),
        (1, 7 * day_ns, 0),
        (20, day_ns, 0),
        // A program that has set the time of recording to the stamp.
        (12, 400 * day_ns, 400 * day_ns),
        (12, -day_ns, -day_ns),
    ] {
        let mut messages = messages(20);
        let mut random = Random(9);
        let end_ns = start_ns + number * 200_000_000;
        let mut sweeps = messages.iter_mut().filter(|m| m.topic == "/radar/points");
        let sweep = sweeps.nth(number as usize - 1).unwrap();
        sweep.arrival_ns += arrival_ns;
        sweep.bytes = cloud(end_ns + off_ns, &mut random).serialise(Style::CdrLittle, &LAYOUT);
        let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
        let (events, source) = read_all(&path);
        assert!(
            events.is_sorted_by_key(Event::stamp_ns),
            "sweep {number} off by {off_ns}"
        );
        assert_eq!(events.len(), 20 * 51 - 1, "sweep {number} off by {off_ns}");
        assert_eq!(count(source.as_ref(), "stamps_off"), 1);
    }
    // The IMU likewise.
    let mut messages = messages(20);
    let sample = messages
        .iter_mut()
        .filter(|m| m.topic == "/imu/data")
        .nth(333)
        .unwrap();
    sample.bytes = imu(
        Style::CdrLittle,
        start_ns + day_ns,
        [0.0; 3],
        [0.0, 0.0, 9.8],
    );
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let (events, source) = read_all(&path);
    assert_eq!(events.len(), 20 * 51 - 1);
    assert_eq!(count(source.as_ref(), "stamps_off"), 1);
}

#[test]
fn frames_of_a_fleet_have_their_robots_name() {
    let mut messages = messages(9);
    let named = [
        (
            "robot_1/base_link",
            "robot_1/arm",
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ),
        (
            "robot_1/arm",
            "left_radar_link",
            [0.5, 0.25, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ),
    ];
    messages[0].bytes = transforms(Style::CdrLittle, &named);
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages, 40_000));
    let (_, source) = read_all(&path);
    let radar = source.info().extrinsics.radar.unwrap();
    assert_eq!(radar.to_array(), [1.5, 0.25, 0.0]);
}

#[test]
fn a_folder_of_logs_and_a_mission_are_one_drive() {
    let (_folder, path) = file("a.mcap", &mcap_bag(&messages(12), 40_000));
    let (events, source) = read_all(&path);
    let expected = fingerprint(&events);
    let mission = tempfile::tempdir().unwrap();
    let logs = mission.path().join("logs");
    std::fs::create_dir(&logs).unwrap();
    // Not in the order of their names; the last one was not finished.
    for (name, part) in [
        ("b.mcap", 0..205),
        ("a.mcap", 205..400),
        ("c.mcap.active", 400..events.len()),
    ] {
        let log = log_of(&events[part], source.info());
        std::fs::write(logs.join(name), log).unwrap();
    }
    std::fs::write(logs.join("notes.txt"), "none").unwrap();
    for folder in [mission.path(), &logs] {
        let (again, source) = read_all(folder);
        assert!(fingerprint(&again) == expected);
        assert_eq!(source.info().scans, Some(12));
        assert!(source.counters().is_empty(), "{:?}", source.counters());
    }
}
