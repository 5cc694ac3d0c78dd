//! What is written is read; what is damaged is counted; nothing panics.

mod damage;

use proptest::prelude::*;
use randt_log::{
    Channel, Compression, DamageKind, Error, LogFile, LogReader, LogWriter, Options, RecordHeader,
    Robot,
};
use randt_messages::{
    ImuSampleTopic, Message, MessageRef, RadarPoints, RadarScan, Return, ScanHead, Topic,
    TruthPose, TruthPoseTopic,
};
use std::io::Cursor;

fn scan(sequence: u64, returns: usize) -> Message<RadarScan> {
    let mut scan = Message::<RadarScan>::default();
    scan.head.header.sequence = sequence;
    scan.head.header.stamp_ns = 1_700_000_000_000_000_000 + 200_000_000 * sequence as i64;
    scan.head.sweep.beam_count = 1;
    for bin in 0..returns {
        let intensity = (bin * 7919 % 1013) as f32;
        scan.items.push(Return {
            range_m: bin as f32 * 0.0161,
            intensity,
            beam: 0,
            bin: bin as u16,
        });
    }
    scan
}

fn sample(sequence: u64) -> Message<ImuSampleTopic> {
    let mut sample = Message::<ImuSampleTopic>::default();
    sample.head.header.sequence = sequence;
    sample.head.rate_rad_s = [0.1, -0.2, sequence as f64];
    sample
}

/// A log of `count` scans with a sample after each, one chunk for every few scans.
fn log(count: u64, returns: usize, compression: Option<Compression>) -> Vec<u8> {
    let options = Options {
        compression,
        written_by: "test 1".to_owned(),
        ..Options::default()
    };
    let mut writer = LogWriter::new(Cursor::new(Vec::new()), "t", options).unwrap();
    writer
        .write_metadata(randt_log::ROBOT_METADATA, Robot::default().to_metadata())
        .unwrap();
    for sequence in 0..count {
        writer.write(scan(sequence, returns).as_ref()).unwrap();
        writer.write(sample(sequence).as_ref()).unwrap();
        if sequence % 3 == 2 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap().into_inner()
}

/// Reads everything: the scans' sequence numbers and the damage. Checks every scan that it gets;
/// only one in a chunk that is cut has no checksum.
fn read(bytes: Vec<u8>, returns: usize) -> (Vec<u64>, Vec<DamageKind>) {
    let Ok(mut reader) = LogReader::new(Cursor::new(bytes), "t") else {
        return Default::default();
    };
    let mut sequences = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        if let Ok(Some(found)) = entry.decode::<RadarScan>() {
            let sequence = found.head.header.sequence;
            let cut = reader
                .damage()
                .iter()
                .any(|damage| damage.kind == DamageKind::Cut);
            assert!(
                cut || found == scan(sequence, returns),
                "scan {sequence} is not as written"
            );
            sequences.push(sequence);
        }
    }
    (
        sequences,
        reader.damage().iter().map(|damage| damage.kind).collect(),
    )
}

#[test]
fn what_is_written_is_read_in_its_order() {
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        let bytes = log(10, 500, compression);
        let mut reader = LogReader::new(Cursor::new(bytes), "t").unwrap();
        assert_eq!(reader.robot().unwrap(), Robot::default());
        assert_eq!(reader.written_by(), "test 1");
        for sequence in 0..10 {
            let entry = reader.next_entry().unwrap().unwrap();
            assert_eq!(
                entry.time_ns,
                1_700_000_000_000_000_000 + 200_000_000 * sequence as i64
            );
            assert_eq!(
                entry.decode::<RadarScan>().unwrap().unwrap(),
                scan(sequence, 500)
            );
            assert!(entry.decode::<RadarPoints>().unwrap().is_none());
            let entry = reader.next_entry().unwrap().unwrap();
            assert_eq!(
                entry.decode::<ImuSampleTopic>().unwrap().unwrap(),
                sample(sequence)
            );
        }
        assert!(reader.next_entry().unwrap().is_none());
        assert!(reader.damage().is_empty());
        let counts: Vec<_> = reader
            .channels()
            .map(|c| (c.topic.as_str(), c.messages))
            .collect();
        assert_eq!(counts, [("radar/scan/v1", 10), ("imu/sample/v1", 10)]);
    }
}

#[test]
fn the_same_messages_make_the_same_bytes() {
    assert!(log(7, 300, Some(Compression::Lz4)) == log(7, 300, Some(Compression::Lz4)));
}

#[test]
fn a_layout_that_nothing_describes_is_refused_and_its_writer_named() {
    let options = Options {
        written_by: "randt 0.0.7".to_owned(),
        ..Options::default()
    };
    let scan = scan(0, 1);
    let mut bytes = Vec::new();
    scan.as_ref().write_bytes(&mut bytes);
    const NAME: &str = "RadarScan-0123456789abcdef";
    let known = Channel::from_topic::<RadarScan>();
    let definition = |fields: &str| format!("# layout {NAME}, topic x\n{fields}\n");
    for (encoding, schema) in [
        ("protobuf", "message".to_owned()),
        ("randt-layout", "message: ScanHead\n".to_owned()),
        (
            "randt-layout",
            "message: A\nstruct A, 8 bytes\n  4 8 header u64\n".to_owned(),
        ),
        (
            "randt-layout",
            "message: A\nstruct A, 8 bytes\n  0 8 header A\n".to_owned(),
        ),
        (
            "randt-layout",
            "message: A\nstruct A, 0 bytes\n  0 0 header [u8; 0]\n".to_owned(),
        ),
        ("ros2msg", definition("uint64 header")),
        ("ros2msg", definition("string header")),
        ("ros2msg", definition("randt_msgs/Header header")),
        ("ros2msg", definition("uint8[0] header")),
    ] {
        let channel = Channel {
            type_name: NAME.to_owned(),
            schema_encoding: encoding.to_owned(),
            schema: schema.as_bytes().to_vec(),
            ..known.clone()
        };
        let cursor = Cursor::new(Vec::new());
        let mut writer = LogWriter::new(cursor, "t", options.clone()).unwrap();
        let id = writer.declare(&channel).unwrap();
        let record = RecordHeader::from_header(&scan.head.header);
        writer.write_bytes(id, record, &bytes).unwrap();
        let log = writer.finish().unwrap().into_inner();
        let mut reader = LogReader::new(Cursor::new(log), "old.mcap").unwrap();
        let entry = reader.next_entry().unwrap().unwrap();
        let error = entry.decode::<RadarScan>().unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, Error::Layout { .. }), "{schema}: {text}");
        for part in [
            "old.mcap",
            "randt 0.0.7",
            "0123456789abcdef",
            RadarScan::TYPE_NAME,
        ] {
            assert!(text.contains(part), "{text}");
        }
    }
}

#[test]
fn a_file_that_is_no_log_is_refused() {
    for bytes in [&b""[..], b"\x89MCAP", b"#ROSBAG V2.0\n"] {
        let error = LogReader::new(Cursor::new(bytes), "x.bag").unwrap_err();
        assert!(matches!(error, Error::NotMcap { .. }), "{error}");
    }
}

#[test]
fn a_file_has_its_name_only_when_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let active = folder.path().join("drive.mcap.active");
    let mut file = LogFile::create(&path, Options::default()).unwrap();
    file.write(scan(0, 100).as_ref()).unwrap();
    let truth = TruthPose {
        pose: [1.0, 2.0, 3.0],
        ..TruthPose::default()
    };
    file.write(MessageRef::<TruthPoseTopic> {
        head: &truth,
        items: &[],
    })
    .unwrap();
    assert!(active.exists() && !path.exists());
    let size = file.finish().unwrap();
    assert!(path.exists() && !active.exists());
    assert_eq!(std::fs::metadata(&path).unwrap().len(), size);
    let mut reader = LogReader::open(&path).unwrap();
    reader.next_entry().unwrap().unwrap();
    let entry = reader.next_entry().unwrap().unwrap();
    assert_eq!(
        *entry.decode::<TruthPoseTopic>().unwrap().unwrap().head,
        truth
    );
}

#[test]
fn a_log_whose_writer_was_killed_is_read_up_to_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut file = LogFile::create(&path, Options::default()).unwrap();
    for sequence in 0..40 {
        file.write(scan(sequence, 9000).as_ref()).unwrap();
    }
    // What a kill at this instant would leave: an open chunk whose length is not known yet.
    let bytes = std::fs::read(folder.path().join("drive.mcap.active")).unwrap();
    let (sequences, damage) = read(bytes, 9000);
    assert!(sequences.len() >= 30, "{}", sequences.len());
    assert!(sequences.iter().copied().eq(0..sequences.len() as u64));
    assert_eq!(damage, [DamageKind::Cut]);
}

#[test]
fn an_unwritable_folder_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = LogFile::create(
        &folder.path().join("no/such/drive.mcap"),
        Options::default(),
    )
    .unwrap_err();
    assert!(
        error.to_string().contains("no/such/drive.mcap.active"),
        "{error}"
    );
}

proptest! {
    #[test]
    fn changed_bytes_never_panic_and_never_change_a_scan(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        compression in prop::sample::select(vec![None, Some(Compression::Lz4), Some(Compression::Zstd)]),
    ) {
        let mut bytes = log(9, 40, compression);
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        // Checks each scan; a checksum stands before each.
        read(bytes, 40);
    }

    #[test]
    fn any_bytes_behind_the_magic_are_read_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut file = b"\x89MCAP0\r\n".to_vec();
        file.extend(bytes);
        read(file, 0);
    }

    #[test]
    fn any_bytes_of_a_message_are_a_message_or_none(size in 0..60_usize, fill in any::<u64>()) {
        // Around the head's size: whole items, broken items, a broken head.
        let bytes: Vec<u8> = (0..size_of::<ScanHead>() - 20 + size)
            .map(|at| (fill.rotate_left(at as u32 % 64) ^ at as u64) as u8)
            .collect();
        let message = Message::<RadarScan>::from_bytes(&bytes);
        let tail = bytes.len().checked_sub(size_of::<ScanHead>());
        prop_assert_eq!(message.is_some(), tail.is_some_and(|tail| tail % 12 == 0));
        if let Some(message) = message {
            let mut again = Vec::new();
            message.as_ref().write_bytes(&mut again);
            prop_assert!(again == bytes);
            // No index of a hostile table leads outside the slice.
            for beam in 0..2000 {
                let range = message.head.sweep.returns_of(beam, message.items.len());
                prop_assert!(message.items.get(range).is_some());
            }
        }
    }
}

#[test]
fn a_copy_has_the_same_messages() {
    let bytes = log(6, 40, Some(Compression::Lz4));
    let mut reader = LogReader::new(Cursor::new(&bytes), "t").unwrap();
    let mut writer = LogWriter::new(Cursor::new(Vec::new()), "c", Options::default()).unwrap();
    let kept = randt_log::copy(&mut reader, &mut writer, |entry| entry.sequence > 2).unwrap();
    assert_eq!(kept, 6);
    let copy = writer.finish().unwrap().into_inner();
    let mut first = LogReader::new(Cursor::new(&copy), "c").unwrap();
    assert!(first.metadata(randt_log::ROBOT_METADATA).is_some());
    let mut second = LogReader::new(Cursor::new(&bytes), "t").unwrap();
    while let Some(entry) = second.next_entry().unwrap() {
        if entry.sequence > 2 {
            let same = first.next_entry().unwrap().unwrap();
            assert_eq!(
                (same.channel.schema.clone(), same.bytes),
                (entry.channel.schema.clone(), entry.bytes)
            );
            assert_eq!(same.record_header(), entry.record_header());
        }
    }
    assert!(first.next_entry().unwrap().is_none());
}
