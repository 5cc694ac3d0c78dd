//! Fields that an earlier build had under another name, in a bit of another field or with other
//! codes.

use randt_log::{Channel, LogReader, LogWriter, Options, RecordHeader};
use randt_messages::{
    Correction, Header, MapperCorrection, Message, RadarScan, Return, SensorKind, Topic,
};
use std::io::Cursor;

/// Who writes the logs of these tests.
const WRITER: &str = concat!("randt-log ", env!("CARGO_PKG_VERSION"));

/// Codes by their names, as they were.
pub struct MoodBefore;
impl MoodBefore {
    /// With those names.
    pub const CODES: randt_messages::layout::Codes = &[(0, "bad"), (1, "good"), (2, "mixed")];
}
/// The same as they are: numbered otherwise, and without one.
pub struct MoodNow;
impl MoodNow {
    /// With those names.
    pub const CODES: randt_messages::layout::Codes = &[(0, "unknown"), (1, "bad"), (2, "good")];
}

mod before {
    use randt_messages::Header;

    randt_messages::plain! {
        /// One of several.
        pub struct Wheel { pub turned_m: f32, pub flags: u32 }
        /// The fixed part.
        pub struct Drive {
            pub header: Header,
            pub way_m: f64,
            #[code(super::MoodBefore)]
            pub mood: u32,
            #[code(super::MoodBefore)]
            pub kept: u32,
        }
    }
    randt_messages::topic! {
        /// Of these.
        Drives = "test/drive/v1": Drive, [Wheel; 100];
    }
}

mod now {
    use randt_messages::Header;

    randt_messages::plain! {
        /// One of several.
        pub struct Turn {
            #[was_bit(flags, 9)]
            pub slips: u32,
            pub flags: u32,
            #[was(turned_m)]
            pub path_m: f64,
        }
        /// The fixed part.
        pub struct Drive {
            pub header: Header,
            #[was(length_m)]
            #[was(way_m)]
            pub path_m: f64,
            #[code(super::MoodNow)]
            pub mood: u32,
            #[code(super::MoodBefore)]
            pub kept: u32,
        }
    }
    randt_messages::topic! {
        /// Of these.
        Drives = "test/drive/v1": Drive, [Turn; 100];
    }
}

/// A log with one message that is bytes already.
fn log(channel: &Channel, bytes: &[u8]) -> LogReader<Cursor<Vec<u8>>> {
    let cursor = Cursor::new(Vec::new());
    let mut writer = LogWriter::new(cursor, "then.mcap", Options::default()).unwrap();
    let id = writer.declare(channel).unwrap();
    writer
        .write_bytes(id, RecordHeader::default(), bytes)
        .unwrap();
    let bytes = writer.finish().unwrap().into_inner();
    LogReader::new(Cursor::new(bytes), "then.mcap").unwrap()
}

fn bytes_of<T: Topic>(message: &Message<T>) -> Vec<u8> {
    let mut bytes = Vec::new();
    message.as_ref().write_bytes(&mut bytes);
    bytes
}

#[test]
fn a_renamed_field_a_moved_bit_and_renumbered_codes_are_read() {
    for (mood, expected) in [(0, 1), (1, 2), (2, u32::MAX), (7, 7)] {
        let mut message = Message::<before::Drives>::default();
        message.head.header.stamp_ns = 5;
        (message.head.way_m, message.head.mood, message.head.kept) = (2.5, mood, mood);
        message.items = [(0.5, 1), (1.5, 0x201), (2.5, 0x200)]
            .map(|(turned_m, flags)| before::Wheel { turned_m, flags })
            .into();
        let channel = Channel::from_topic::<before::Drives>();
        let mut bytes = Vec::new();
        randt_log::write_cdr(message.as_ref(), &mut bytes);
        let mut reader = log(&channel, &bytes);
        let entry = reader.next_entry().unwrap().unwrap();
        let read = entry.decode::<now::Drives>().unwrap().unwrap();
        assert_eq!((read.head.header.stamp_ns, read.head.path_m), (5, 2.5));
        assert_eq!((read.head.mood, read.head.kept), (expected, mood));
        let turns =
            [(0.5, 1, 0), (1.5, 1, 1), (2.5, 0, 1)].map(|(path_m, flags, slips)| now::Turn {
                slips,
                flags,
                path_m,
            });
        assert_eq!(read.items, turns);
        // Nothing lacks, and nothing is left over.
        let said: Vec<String> = reader.translated().collect();
        assert_eq!(
            said,
            [format!(
                "then.mcap: test/drive/v1 was written by another build ({WRITER})"
            )]
        );
    }
}

#[test]
fn what_is_no_list_of_codes_is_refused() {
    let table = format!(
        "message: Drive\n{HEADER}struct Drive, 48 bytes
  0 32 header Header
  32 8 way_m f64
  40 4 mood u32
codes mood: 0 bad, 1 good, 2 mixed
  44 4 kept u32
"
    );
    let bytes = bytes_of(&Message::<before::Drives>::default());
    let decode = |table: &str| {
        let mut reader = log(&described(before::Drives::NAME, table), &bytes);
        let entry = reader.next_entry().unwrap().unwrap();
        entry.decode::<now::Drives>().is_ok()
    };
    assert!(decode(&table));
    for other in [
        "codes kept: 0 bad",
        "codes mood: bad",
        "codes mood",
        "codes mood: -1 bad",
    ] {
        let changed = table.replace("codes mood: 0 bad, 1 good, 2 mixed", other);
        assert!(!decode(&changed), "{other}");
    }
}

/// The layout of a topic as the last build before the renames described it.
fn described(topic: &str, lines: &str) -> Channel {
    Channel {
        topic: topic.to_owned(),
        type_name: "Then-0123456789abcdef".to_owned(),
        message_encoding: "randt".to_owned(),
        schema_encoding: "randt-layout".to_owned(),
        schema: lines.as_bytes().to_vec(),
        ..Channel::default()
    }
}

const HEADER: &str = "struct Header, 32 bytes
  0 8 sequence u64
  8 8 stamp_ns i64
  16 8 epoch u64
  24 8 published_ns i64
";

#[test]
fn a_correction_of_before_names_its_component() {
    let channel = described(
        MapperCorrection::NAME,
        &format!(
            "message: Correction\n{HEADER}struct Correction, 80 bytes
  0 32 header Header
  32 8 graph_version u64
  40 8 odom_frame_id u64
  48 8 part u64
  56 24 pose [f64; 3]
"
        ),
    );
    let expected = Correction {
        header: Header {
            stamp_ns: 7,
            ..Header::default()
        },
        graph_version: 3,
        odom_frame_id: 5,
        component: 4,
        map_from_odom: [1.0, -2.0, 0.5],
    };
    let mut message = Message::<MapperCorrection>::default();
    *message.head = expected;
    let mut reader = log(&channel, &bytes_of(&message));
    let entry = reader.next_entry().unwrap().unwrap();
    let read = entry.decode::<MapperCorrection>().unwrap().unwrap();
    assert_eq!(*read.head, expected);
}

#[test]
fn a_contested_sweep_of_before_has_it_in_the_highest_bit_of_its_sensor() {
    let channel = described(
        RadarScan::NAME,
        &format!(
            "message: ScanHead\nthen: Return until its end, at most 65536\n{HEADER}struct Beam, 16 bytes
  0 8 stamp_ns i64
  8 4 azimuth_rad f32
  12 4 first_return u32
struct SweepHead, 16424 bytes
  0 8 begin_ns i64
  8 8 end_ns i64
  16 4 sensor u32
  20 4 beam_count u32
  24 4 beams_lost u32
  28 4 returns_dropped u32
  32 4 range_resolution_m f32
  36 4 azimuth_step_rad f32
  40 16384 beams [Beam; MAX_BEAMS]
struct ScanHead, 16456 bytes
  0 32 header Header
  32 16424 sweep SweepHead
struct Return, 12 bytes
  0 4 range_m f32
  4 4 intensity f32
  8 2 beam u16
  10 2 bin u16
"
        ),
    );
    for (sensor, contested) in [(0x8000_0001_u32, 1), (1, 0)] {
        let mut expected = Message::<RadarScan>::default();
        expected.head.header.stamp_ns = 9;
        let sweep = &mut expected.head.sweep;
        (sweep.begin_ns, sweep.end_ns) = (1, 9);
        (sweep.sensor, sweep.contested) = (SensorKind::IsdrC as u32, contested);
        (sweep.beam_count, sweep.beams_lost, sweep.returns_dropped) = (1024, 2, 3);
        (sweep.range_resolution_m, sweep.azimuth_step_rad) = (0.25, 0.5);
        for (beam, at) in sweep.beams.iter_mut().zip(0..) {
            (beam.stamp_ns, beam.first_return) = (at.into(), at);
        }
        expected.items = vec![Return::default(); 4];
        // The bytes of before: the bit is in the sensor, and `contested` is not there.
        let mut then = bytes_of(&expected);
        then.drain(32 + 40..32 + 48);
        then[32 + 16..32 + 20].copy_from_slice(&sensor.to_le_bytes());
        let mut reader = log(&channel, &then);
        let entry = reader.next_entry().unwrap().unwrap();
        let read = entry.decode::<RadarScan>().unwrap().unwrap();
        assert!(read == expected, "{:?}", read.head.sweep.sensor);
        let said: Vec<String> = reader.translated().collect();
        assert!(said[0].ends_with(&format!("({WRITER})")), "{said:?}");
    }
}
