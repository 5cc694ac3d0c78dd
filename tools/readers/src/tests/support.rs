//! Writers of ROS messages and bags, small and only for tests, and a seeded source of numbers.

use crate::ros::Encoding;
use crate::{Event, Options, Source, open};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The recordings, or `None` (and a word about it) where they are absent; under CI they must be there.
pub fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("RANDT_DATA").map(PathBuf::from);
    let folder = folder
        .unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"));
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "{}: absent, and CI=true does not skip",
        path.display()
    );
    println!("skipped: no data ({})", path.display());
    None
}

/// SplitMix64: the same numbers for the same seed everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// How a test serialises: the mirror image of `Wire`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Style {
    Ros1,
    CdrLittle,
    CdrBig,
}

impl Style {
    pub fn encoding(self) -> Encoding {
        if self == Self::Ros1 {
            Encoding::Ros1
        } else {
            Encoding::Cdr
        }
    }
}

pub struct Pen {
    pub bytes: Vec<u8>,
    style: Style,
}

impl Pen {
    pub fn new(style: Style) -> Self {
        let bytes = match style {
            Style::Ros1 => vec![],
            Style::CdrLittle => vec![0, 1, 0, 0],
            Style::CdrBig => vec![0, 0, 0, 0],
        };
        Self { bytes, style }
    }

    fn put<const N: usize>(&mut self, mut little: [u8; N]) {
        if self.style != Style::Ros1 {
            while !(self.bytes.len() - 4).is_multiple_of(N) {
                self.bytes.push(0);
            }
        }
        if self.style == Style::CdrBig {
            little.reverse();
        }
        self.bytes.extend(little);
    }

    pub fn u8(&mut self, value: u8) {
        self.put([value]);
    }
    pub fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }
    pub fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }
    pub fn blob(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
    }
    pub fn string(&mut self, text: &str) {
        if self.style == Style::Ros1 {
            self.blob(text.as_bytes());
        } else {
            self.blob(format!("{text}\0").as_bytes());
        }
    }
    pub fn header(&mut self, stamp_ns: i64, frame: &str) {
        if self.style == Style::Ros1 {
            self.u32(7);
        }
        self.u32((stamp_ns / 1_000_000_000) as u32);
        self.u32((stamp_ns % 1_000_000_000) as u32);
        self.string(frame);
    }
}

/// How a cloud's points are laid out.
#[derive(Clone, Debug)]
pub struct CloudLayout {
    pub point_step: usize,
    /// Offsets of x, y, z, intensity.
    pub offsets: [usize; 4],
    pub big_endian: bool,
    /// 7 for f32, 8 for f64.
    pub datatype: u8,
    pub row_padding: usize,
    pub rows: usize,
    pub intensity_name: &'static str,
}

impl CloudLayout {
    /// As the published data set has it.
    pub const AS_PUBLISHED: Self = Self {
        point_step: 16,
        offsets: [0, 4, 8, 12],
        big_endian: false,
        datatype: 7,
        row_padding: 0,
        rows: 1,
        intensity_name: "intensity",
    };
}

/// A cloud of (x, y, intensity).
#[derive(Clone, Debug)]
pub struct TestCloud {
    pub stamp_ns: i64,
    pub points: Vec<(f64, f64, f64)>,
}

impl TestCloud {
    pub fn serialise(&self, style: Style, layout: &CloudLayout) -> Vec<u8> {
        let mut pen = Pen::new(style);
        pen.header(self.stamp_ns, "left_radar_link");
        let rows = if layout.rows > 0 && self.points.len().is_multiple_of(layout.rows) {
            layout.rows
        } else {
            1
        };
        let width = self.points.len() / rows;
        pen.u32(rows as u32);
        pen.u32(width as u32);
        let names = ["x", "y", "z", layout.intensity_name];
        pen.u32(5);
        // A field that nobody asked for, of a datatype that nobody knows.
        pen.string("elevation_index");
        pen.u32(1);
        pen.u8(200);
        pen.u32(1);
        for (name, offset) in names.iter().zip(layout.offsets) {
            pen.string(name);
            pen.u32(offset as u32);
            pen.u8(layout.datatype);
            pen.u32(1);
        }
        pen.u8(u8::from(layout.big_endian));
        pen.u32(layout.point_step as u32);
        let row_step = width * layout.point_step + layout.row_padding;
        pen.u32(row_step as u32);
        let mut data = vec![0xa5; rows * row_step];
        for (index, (x, y, intensity)) in self.points.iter().enumerate() {
            let start = index / width * row_step + index % width * layout.point_step;
            for (value, offset) in [*x, *y, 0.0, *intensity].into_iter().zip(layout.offsets) {
                let mut bytes = if layout.datatype == 7 {
                    (value as f32).to_le_bytes().to_vec()
                } else {
                    value.to_le_bytes().to_vec()
                };
                if layout.big_endian {
                    bytes.reverse();
                }
                data[start + offset..start + offset + bytes.len()].copy_from_slice(&bytes);
            }
        }
        pen.blob(&data);
        pen.u8(1);
        pen.bytes
    }
}

/// An IMU message as drivers without orientation send it.
pub fn imu(style: Style, stamp_ns: i64, rate: [f64; 3], acceleration: [f64; 3]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.header(stamp_ns, "imu_link");
    for value in [0.0; 4] {
        pen.f64(value);
    }
    pen.f64(-1.0);
    (0..8).for_each(|_| pen.f64(0.0));
    rate.iter().for_each(|value| pen.f64(*value));
    (0..9).for_each(|_| pen.f64(0.0));
    acceleration.iter().for_each(|value| pen.f64(*value));
    (0..9).for_each(|_| pen.f64(0.0));
    pen.bytes
}

/// (parent, child, translation, quaternion x y z w).
pub type TestTransform = (&'static str, &'static str, [f64; 3], [f64; 4]);

pub fn transforms(style: Style, transforms: &[TestTransform]) -> Vec<u8> {
    let mut pen = Pen::new(style);
    pen.u32(transforms.len() as u32);
    for (parent, child, translation, rotation) in transforms {
        pen.header(0, parent);
        pen.string(child);
        translation
            .iter()
            .chain(rotation)
            .for_each(|value| pen.f64(*value));
    }
    pen.bytes
}

/// A message on its way into a bag.
#[derive(Clone, Debug)]
pub struct TestMessage {
    pub topic: &'static str,
    /// In ROS 1's spelling.
    pub type_name: &'static str,
    pub arrival_ns: i64,
    pub bytes: Vec<u8>,
}

pub const CLOUD: &str = "sensor_msgs/PointCloud2";
pub const IMU: &str = "sensor_msgs/Imu";
pub const TF: &str = "tf2_msgs/TFMessage";

fn field(out: &mut Vec<u8>, name: &str, value: &[u8]) {
    out.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
    out.extend(name.as_bytes());
    out.push(b'=');
    out.extend(value);
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    fields
        .iter()
        .for_each(|(name, value)| field(&mut header, name, value));
    let mut out = (header.len() as u32).to_le_bytes().to_vec();
    out.extend(header);
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out
}

fn ros_time(ns: i64) -> [u8; 8] {
    let mut time = [0; 8];
    time[..4].copy_from_slice(&((ns / 1_000_000_000) as u32).to_le_bytes());
    time[4..].copy_from_slice(&((ns % 1_000_000_000) as u32).to_le_bytes());
    time
}

/// A ROS 1 bag of chunks of `per_chunk` messages.
pub fn ros1_bag(messages: &[TestMessage], compression: &str, per_chunk: usize) -> Vec<u8> {
    let mut topics: Vec<(&str, &str)> = Vec::new();
    for message in messages {
        if !topics.contains(&(message.topic, message.type_name)) {
            topics.push((message.topic, message.type_name));
        }
    }
    let connection = |number: usize| {
        let (topic, type_name) = topics[number];
        let mut data = Vec::new();
        field(&mut data, "topic", topic.as_bytes());
        field(&mut data, "type", type_name.as_bytes());
        field(&mut data, "md5sum", b"*");
        record(
            &[
                ("op", &[7]),
                ("conn", &(number as u32).to_le_bytes()),
                ("topic", topic.as_bytes()),
            ],
            &data,
        )
    };
    let mut bag = b"#ROSBAG V2.0\n".to_vec();
    let bag_header = |index_at: u64, chunks: u32| {
        let fields: [(&str, &[u8]); 4] = [
            ("op", &[3]),
            ("index_pos", &index_at.to_le_bytes()),
            ("conn_count", &(topics.len() as u32).to_le_bytes()),
            ("chunk_count", &chunks.to_le_bytes()),
        ];
        record(&fields, &[b' '; 100])
    };
    let header_at = bag.len();
    bag.extend(bag_header(0, 0));
    let mut infos = Vec::new();
    for part in messages.chunks(per_chunk) {
        let mut inside = Vec::new();
        let mut counts = vec![0_u32; topics.len()];
        for message in part {
            let number = topics
                .iter()
                .position(|t| *t == (message.topic, message.type_name))
                .unwrap();
            if counts[number] == 0 {
                inside.extend(connection(number));
            }
            counts[number] += 1;
            let conn = (number as u32).to_le_bytes();
            let time = ros_time(message.arrival_ns);
            inside.extend(record(
                &[("op", &[2]), ("conn", &conn), ("time", &time)],
                &message.bytes,
            ));
        }
        let stored = match compression {
            "none" => inside.clone(),
            "bz2" => {
                let mut encoder =
                    bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
                encoder.write_all(&inside).unwrap();
                encoder.finish().unwrap()
            }
            "lz4" => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&inside).unwrap();
                encoder.finish().unwrap()
            }
            other => panic!("{other}"),
        };
        let at = bag.len() as u64;
        let size = (inside.len() as u32).to_le_bytes();
        bag.extend(record(
            &[
                ("compression", compression.as_bytes()),
                ("op", &[5]),
                ("size", &size),
            ],
            &stored,
        ));
        for (number, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let conn = (number as u32).to_le_bytes();
            let fields: [(&str, &[u8]); 4] = [
                ("op", &[4]),
                ("ver", &[1, 0, 0, 0]),
                ("conn", &conn),
                ("count", &count.to_le_bytes()),
            ];
            bag.extend(record(&fields, &vec![0; 12 * *count as usize]));
        }
        infos.push(record(
            &[
                ("op", &[6]),
                ("ver", &[1, 0, 0, 0]),
                ("chunk_pos", &at.to_le_bytes()),
            ],
            &[],
        ));
    }
    let index_at = bag.len() as u64;
    (0..topics.len()).for_each(|number| bag.extend(connection(number)));
    infos.iter().for_each(|info| bag.extend(info));
    let header = bag_header(index_at, infos.len() as u32);
    bag[header_at..header_at + header.len()].copy_from_slice(&header);
    bag
}

fn ros2_type(type_name: &str) -> String {
    type_name.replace('/', "/msg/")
}

/// The same messages as an MCAP file; they must be serialised as CDR.
pub fn mcap_bag(messages: &[TestMessage], chunk_size: u64) -> Vec<u8> {
    let mut writer = mcap::WriteOptions::new()
        .chunk_size(Some(chunk_size))
        .create(std::io::Cursor::new(Vec::new()))
        .unwrap();
    for message in messages {
        let schema = writer
            .add_schema(&ros2_type(message.type_name), "ros2msg", b"")
            .unwrap();
        let channel = writer
            .add_channel(schema, message.topic, "cdr", &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: message.arrival_ns as u64,
            publish_time: message.arrival_ns as u64,
        };
        writer
            .write_to_known_channel(&header, &message.bytes)
            .unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// The same messages as a database; they must be serialised as CDR.
pub fn database_bag(messages: &[TestMessage], path: &Path) {
    let connection = rusqlite::Connection::open(path).unwrap();
    connection
        .execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
             CREATE INDEX timestamp_idx ON messages (timestamp ASC);
             BEGIN",
        )
        .unwrap();
    let mut topics: Vec<&str> = Vec::new();
    for message in messages {
        if !topics.contains(&message.topic) {
            topics.push(message.topic);
            let row = (
                topics.len() as i64,
                message.topic,
                ros2_type(message.type_name),
                "cdr",
                "",
            );
            connection
                .execute("INSERT INTO topics VALUES (?1, ?2, ?3, ?4, ?5)", row)
                .unwrap();
        }
        let topic = topics.iter().position(|t| *t == message.topic).unwrap() + 1;
        connection
            .execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)",
                (topic as i64, message.arrival_ns, &message.bytes),
            )
            .unwrap();
    }
    connection.execute_batch("COMMIT").unwrap();
}

/// A small recording: a room seen by a turning radar, an IMU, a mounting. `sweeps` of about 500 returns.
pub fn recording(style: Style, layout: &CloudLayout, sweeps: usize) -> Vec<TestMessage> {
    let start_ns = 1_700_000_000_000_000_000;
    let mut random = Random(42);
    let mut messages = vec![TestMessage {
        topic: "/tf_static",
        type_name: TF,
        arrival_ns: start_ns,
        bytes: transforms(style, &[MOUNT_RADAR, MOUNT_IMU]),
    }];
    for sweep in 1..=sweeps as i64 {
        let end_ns = start_ns + sweep * 200_000_000;
        for sample in 0..50 {
            let stamp_ns = end_ns - 200_000_000 + sample * 4_000_000 + 2_000_000;
            messages.push(TestMessage {
                topic: "/imu/data",
                type_name: IMU,
                arrival_ns: stamp_ns + 1000,
                bytes: imu(
                    style,
                    stamp_ns,
                    [0.0, 0.01, 0.1 * random.unit()],
                    [0.1, 0.0, 9.81],
                ),
            });
        }
        messages.push(TestMessage {
            topic: "/radar/points",
            type_name: CLOUD,
            arrival_ns: end_ns + 3000,
            bytes: cloud(end_ns, &mut random).serialise(style, layout),
        });
    }
    messages
}

pub const MOUNT_RADAR: TestTransform = (
    "base_link",
    "left_radar_link",
    [0.3, -0.1, 0.4],
    [0.0, 0.0, 0.0, 1.0],
);
/// Upside down: half a turn about x.
pub const MOUNT_IMU: TestTransform = ("base_link", "imu_link", [0.0; 3], [1.0, 0.0, 0.0, 0.0]);

/// One sweep of 220 beams, some without a return, on the iSDR-C's grid; coordinates are f32's.
pub fn cloud(stamp_ns: i64, random: &mut Random) -> TestCloud {
    use randt_geometry::elementary::{PI, sin_cos};
    let mut points = Vec::new();
    for beam in 0..220 {
        let (sin, cos) = sin_cos(-PI + f64::from(beam) * 2.0 * PI / 220.0);
        let mut bin = 1 + random.below(400);
        for _ in 0..random.below(6) {
            let range = bin as f64 * 0.0161;
            let intensity = 6.0 + 20.0 * random.unit();
            let single = |value: f64| f64::from(value as f32);
            points.push((single(range * cos), single(range * sin), single(intensity)));
            bin += 1 + random.below(3);
        }
    }
    TestCloud { stamp_ns, points }
}

/// Reads an input to its end.
pub fn read_all(path: &Path) -> (Vec<Event>, Box<dyn Source>) {
    read_with(path, &Options::default())
}

pub fn read_with(path: &Path, options: &Options) -> (Vec<Event>, Box<dyn Source>) {
    let mut source = open(path, options).unwrap();
    let mut events = Vec::new();
    while let Some(event) = source.next_event().unwrap() {
        events.push(event);
    }
    (events, source)
}

/// A file of these bytes in a folder that goes away with the first value.
pub fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// The bytes of every message, which is what has to be the same.
pub fn fingerprint(events: &[Event]) -> Vec<Vec<u8>> {
    let bytes = |event: &Event| {
        let mut out = Vec::new();
        match event {
            Event::Scan(scan) => scan.as_ref().write_bytes(&mut out),
            // Arrival is the recorder's.
            Event::Imu(sample) => out.extend_from_slice(format!("{sample:?}").as_bytes()),
            Event::Truth(pose) => out.extend_from_slice(format!("{pose:?}").as_bytes()),
        }
        out
    };
    events.iter().map(bytes).collect()
}

/// These events as one of our logs.
pub fn log_of(events: &[Event], info: &crate::InputInfo) -> Vec<u8> {
    use randt_log::{LogWriter, Options, ROBOT_METADATA, Robot};
    use randt_messages::{ImuSampleTopic, Message};
    let sink = std::io::Cursor::new(Vec::new());
    let mut writer = LogWriter::new(sink, "test.mcap", Options::default()).unwrap();
    let robot = Robot {
        sensor: info.sensor,
        radar: info.extrinsics.radar.map(|pose| pose.to_array()),
        imu: info.extrinsics.imu.map(|rotation| rotation.to_array()),
    };
    writer
        .write_metadata(ROBOT_METADATA, robot.to_metadata())
        .unwrap();
    for (number, event) in events.iter().enumerate() {
        if number % 102 == 101 {
            // Two sweeps a chunk.
            writer.flush().unwrap();
        }
        match event {
            Event::Scan(scan) => writer.write(scan.as_ref()).unwrap(),
            Event::Imu(sample) => {
                let mut message = Message::<ImuSampleTopic>::default();
                *message.head = *sample;
                writer.write(message.as_ref()).unwrap();
            }
            Event::Truth(_) => {}
        }
    }
    writer.finish().unwrap().into_inner()
}
