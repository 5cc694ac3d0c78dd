//! A small recording in every form, a seeded source of numbers, and reading inputs to their end.

mod bag_files;
mod ros_messages;

pub use bag_files::*;
pub use ros_messages::*;

use crate::{Event, Options, Source, open};
use std::path::{Path, PathBuf};

/// The recordings, or `None` (with a message) where they are absent; under CI they must be there.
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

/// A small recording: a room seen by a turning radar, an IMU, a mounting. `sweeps` of about 500
/// returns.
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
            Event::Twist(twist) => out.extend_from_slice(format!("{twist:?}").as_bytes()),
            Event::Truth(pose) => out.extend_from_slice(format!("{pose:?}").as_bytes()),
        }
        out
    };
    events.iter().map(bytes).collect()
}

/// These events as one of our logs.
pub fn log_of(events: &[Event], info: &crate::InputInfo) -> Vec<u8> {
    use randt_log::{LogWriter, Options, ROBOT_METADATA, Robot};
    use randt_messages::{ImuSampleTopic, Message, TwistTopic};
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
            Event::Twist(twist) => {
                let mut message = Message::<TwistTopic>::default();
                *message.head = *twist;
                writer.write(message.as_ref()).unwrap();
            }
            Event::Truth(_) => {}
        }
    }
    writer.finish().unwrap().into_inner()
}
