//! Logs of earlier layouts, kept in `fixtures`: each is read for as long as there are robots that
//! recorded such logs.

use randt_log::{LogReader, LogWriter, Options, ROBOT_METADATA, Robot, channels};
use randt_messages::health::fixed_text;
use randt_messages::{
    Beam, Correction, DropCause, GraphEntry, GraphEntryKind, GraphHead, Header, ImuSample,
    ImuSampleTopic, ImuUse, Keyframe, KeyframeBeam, KeyframeHead, KeyframePoint, LogDrop,
    LogDropTopic, MapperCorrection, MapperGraph, MapperGrid, Message, OdometryState,
    OdometryStateTopic, PointsHead, PortHealth, RadarPoints, RadarScan, Return, ScanHead,
    SensorKind, StageHealth, StageHealthTopic, StageState, SweepHead, TILE_CELLS, TileHead, Topic,
    Trust, TruthPose, TruthPoseTopic,
};
use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Seek, Write};
use std::path::{Path, PathBuf};

/// Logs with one message of every topic. The last one has the layouts of this build.
const KEPT: [&str; 1] = ["layouts-2.mcap"];

fn newest() -> &'static str {
    KEPT.last().unwrap()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

/// A header with another value in each field of each message.
fn header(number: u64) -> Header {
    Header {
        sequence: number + 10,
        stamp_ns: 1_700_000_000_000_000_000 + number as i64,
        epoch: number + 20,
        published_ns: 1_700_000_000_000_000_500 + number as i64,
    }
}

fn message<T: Topic>(head: T::Head, items: Vec<T::Item>) -> Message<T> {
    let mut message = Message::default();
    *message.head = head;
    message.items = items;
    message
}

fn sweep(contested: u64) -> SweepHead {
    let mut sweep = SweepHead {
        begin_ns: 1_699_999_999_800_000_000,
        end_ns: 1_700_000_000_000_000_000,
        sensor: SensorKind::NavtechCts as u32,
        beam_count: 3,
        beams_lost: 4,
        returns_dropped: 5,
        range_resolution_m: 0.125,
        azimuth_step_rad: 0.0625,
        contested,
        ..SweepHead::default()
    };
    for (beam, number) in sweep.beams.iter_mut().zip(0..3) {
        *beam = Beam {
            stamp_ns: 1_699_999_999_900_000_000 + i64::from(number),
            azimuth_rad: -0.5 * number as f32,
            first_return: 2 * number,
        };
    }
    sweep
}

fn returns() -> Vec<Return> {
    let numbers = (0..6_u16).map(|number| Return {
        range_m: 1.5 + f32::from(number),
        intensity: 40.25 - f32::from(number),
        beam: number / 2,
        bin: 100 + number,
    });
    numbers.collect()
}

fn scan() -> Message<RadarScan> {
    let head = ScanHead {
        header: header(1),
        sweep: sweep(1),
    };
    message(head, returns())
}

fn points() -> Message<RadarPoints> {
    let head = PointsHead {
        header: header(2),
        scan_sequence: 31,
        scan_epoch: 32,
        scan_published_ns: 33,
        sweep: sweep(0),
    };
    message(head, returns())
}

fn sample() -> Message<ImuSampleTopic> {
    let head = ImuSample {
        header: header(3),
        device_ns: -41,
        arrival_ns: 42,
        rate_rad_s: [0.1, -0.2, 0.3],
        acceleration_m_s2: [0.4, 0.5, 9.81],
    };
    message(head, Vec::new())
}

fn state() -> Message<OdometryStateTopic> {
    let head = OdometryState {
        header: header(4),
        id: 51,
        scan_sequence: 52,
        scan_epoch: 53,
        odom_frame_id: 54,
        pose: [1.0, 2.0, 0.5],
        retired_stamp_ns: 55,
        retired_pose: [0.75, 1.75, 0.25],
        velocity: [1.25, -0.125, 0.0625],
        gyro_bias_rad_s: [0.001, 0.002, 0.003],
        attitude: [0.5, 0.5, -0.5, 0.5],
        covariance: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        information_eigenvalues: [905.0, 1e6],
        cost: 17.5,
        imu_sequence: 56,
        imu_epoch: 57,
        scan_published_ns: 58,
        imu_published_ns: 59,
        imu_use: ImuUse::Late as u32,
        trust: Trust::Degraded as u32,
        points: 60,
        cells: 61,
        inliers: 62,
        iterations: 63,
        submap_id: 64,
    };
    message(head, Vec::new())
}

fn keyframe() -> Message<Keyframe> {
    let mut head = KeyframeHead {
        header: header(5),
        id: 71,
        odom_frame_id: 72,
        submap_id: 73,
        submap_root: 74,
        scan_sequence: 75,
        pose: [-1.0, 0.5, 3.0],
        covariance: [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0],
        twist: [0.5, 0.25, 0.125],
        beam_count: 2,
        ..KeyframeHead::default()
    };
    for (beam, number) in head.beams.iter_mut().zip(0..2_u8) {
        *beam = KeyframeBeam {
            x_m: 0.25 * f32::from(number),
            y_m: -0.5,
            azimuth_rad: 1.5,
            first_point: 2 * u32::from(number),
        };
    }
    let points = (0..4_u16).map(|number| KeyframePoint {
        x_m: f32::from(number),
        y_m: -2.5,
        intensity: 12.5,
        beam: number / 2,
        reserved: 0,
    });
    message(head, points.collect())
}

fn correction() -> Message<MapperCorrection> {
    let head = Correction {
        header: header(6),
        graph_version: 81,
        odom_frame_id: 82,
        component: 83,
        map_from_odom: [4.0, -5.0, 0.75],
    };
    message(head, Vec::new())
}

fn graph() -> Message<MapperGraph> {
    let head = GraphHead {
        header: header(7),
        graph_version: 91,
        keyframes: 92,
        wanted_keyframe: 93,
        on_disk: 94,
        odom_frame_id: 95,
        loops: 96,
        components: 97,
        path_m: 98.5,
        tiles: 99,
        first_entry: 100,
        send_again: 1,
    };
    let entries = [GraphEntryKind::Node, GraphEntryKind::Loop].map(|kind| GraphEntry {
        a: 101,
        b: 102,
        stamp_ns: 103,
        pose: [6.0, 7.0, -0.25],
        weight: 0.5,
        kind: kind as u32,
    });
    message(head, entries.into())
}

fn tile() -> Message<MapperGrid> {
    let head = TileHead {
        header: header(8),
        grid_version: 111,
        column: -3,
        row: 4,
        resolution_m: 0.05,
    };
    let cells = (0..TILE_CELLS * TILE_CELLS).map(|cell| [0, 100, 255][cell / 7 % 3]);
    message(head, cells.collect())
}

fn health() -> Message<StageHealthTopic> {
    let mut head = StageHealth {
        header: header(9),
        name: fixed_text("odometry"),
        message: fixed_text("no IMU"),
        pid: 121,
        started_ns: 122,
        restarts: 123,
        lost: 124,
        state: StageState::Degraded as u32,
        port_count: 1,
        ..StageHealth::default()
    };
    head.ports[0] = PortHealth {
        topic: fixed_text("radar/points/v1"),
        messages: 125,
        lost: 126,
        last_published_ns: 127,
        publishes: 1,
    };
    message(head, Vec::new())
}

fn truth() -> Message<TruthPoseTopic> {
    let head = TruthPose {
        header: header(10),
        pose: [8.0, 9.0, -3.0],
        velocity: [0.25, 0.5, 0.75],
    };
    message(head, Vec::new())
}

fn missing() -> Message<LogDropTopic> {
    let head = LogDrop {
        header: header(11),
        begin_ns: 131,
        end_ns: 132,
        count: 133,
        topic: fixed_text("imu/sample/v1"),
        cause: DropCause::Full as u32,
        reserved: 0,
    };
    message(head, Vec::new())
}

fn robot() -> Robot {
    Robot {
        sensor: SensorKind::NavtechCts,
        radar: Some([0.12, -0.5, 1.25]),
        imu: Some([0.5, 0.5, -0.5, 0.5]),
    }
}

/// A log with one message of every topic.
fn write<W: Write + Seek>(sink: W) -> W {
    let options = Options {
        written_by: format!("randt 0.1.0, {}", newest()),
        ..Options::default()
    };
    let mut writer = LogWriter::new(sink, newest(), options).unwrap();
    writer
        .write_metadata(ROBOT_METADATA, robot().to_metadata())
        .unwrap();
    writer.write(scan().as_ref()).unwrap();
    writer.write(points().as_ref()).unwrap();
    writer.write(sample().as_ref()).unwrap();
    writer.write(state().as_ref()).unwrap();
    writer.write(keyframe().as_ref()).unwrap();
    writer.write(correction().as_ref()).unwrap();
    writer.write(graph().as_ref()).unwrap();
    writer.write(tile().as_ref()).unwrap();
    writer.write(health().as_ref()).unwrap();
    writer.write(truth().as_ref()).unwrap();
    writer.write(missing().as_ref()).unwrap();
    writer.finish().unwrap()
}

/// The message of a topic, the only one.
fn read<T: Topic>(log: &Path) -> Message<T> {
    let mut reader = LogReader::open(log).unwrap();
    let mut found = None;
    while let Some(entry) = reader.next_entry().unwrap() {
        if let Some(message) = entry.decode::<T>().unwrap() {
            assert!(found.replace(message).is_none(), "{}", T::NAME);
        }
    }
    assert!(reader.damage().is_empty());
    found.unwrap()
}

#[test]
fn every_field_of_a_kept_log_is_read() {
    for name in KEPT {
        let log = fixture(name);
        assert_eq!(LogReader::open(&log).unwrap().robot().unwrap(), robot());
        assert!(read::<RadarScan>(&log) == scan(), "{name}");
        assert!(read::<RadarPoints>(&log) == points(), "{name}");
        assert_eq!(read::<ImuSampleTopic>(&log), sample(), "{name}");
        assert_eq!(read::<OdometryStateTopic>(&log), state(), "{name}");
        assert!(read::<Keyframe>(&log) == keyframe(), "{name}");
        assert_eq!(read::<MapperCorrection>(&log), correction(), "{name}");
        assert_eq!(read::<MapperGraph>(&log), graph(), "{name}");
        assert!(read::<MapperGrid>(&log) == tile(), "{name}");
        assert_eq!(read::<StageHealthTopic>(&log), health(), "{name}");
        assert_eq!(read::<TruthPoseTopic>(&log), truth(), "{name}");
        assert_eq!(read::<LogDropTopic>(&log), missing(), "{name}");
    }
}

/// The messages of a topic of the log that a pipeline recorded before fields were renamed.
fn recorded<T: Topic>() -> Vec<Message<T>> {
    let mut reader = LogReader::open(&fixture("layouts-1.mcap")).unwrap();
    let mut found = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        found.extend(entry.decode::<T>().unwrap());
    }
    assert!(reader.damage().is_empty());
    for text in reader.translated() {
        let is_complete = !text.contains("it has no") && !text.contains("does not know");
        assert!(is_complete, "{text}");
    }
    found
}

/// The values are those that the build of then exported as tables.
#[test]
fn a_recording_from_before_the_renames_lacks_nothing() {
    let scans = recorded::<RadarScan>();
    let lengths: Vec<usize> = scans.iter().map(|scan| scan.items.len()).collect();
    assert_eq!(lengths, [8044, 8006]);
    for (scan, end_ns) in scans
        .iter()
        .zip([1_700_000_007_249_922_102, 1_700_000_007_450_171_740])
    {
        let sweep = &scan.head.sweep;
        assert_eq!((scan.head.header.stamp_ns, sweep.end_ns), (end_ns, end_ns));
        assert_eq!(
            (sweep.sensor, sweep.contested),
            (SensorKind::IsdrC as u32, 0)
        );
        assert_eq!(
            (sweep.beam_count, sweep.azimuth_step_rad),
            (220, 0.028_559_932)
        );
        let last = sweep.beams()[219];
        assert!(last.stamp_ns > sweep.begin_ns && (last.first_return as usize) < scan.items.len());
    }
    let corrections = recorded::<MapperCorrection>();
    assert_eq!(corrections.len(), 1);
    let head = &corrections[0].head;
    assert_eq!(
        (head.graph_version, head.odom_frame_id, head.component),
        (7, 0, 0)
    );
    assert_eq!(head.map_from_odom, [0.0, -2.220_446_049_250_313e-16, 0.0]);
    let graph = recorded::<MapperGraph>();
    assert_eq!(graph.len(), 1);
    let head = &graph[0].head;
    assert_eq!((head.keyframes, head.components), (7, 1));
    let states = recorded::<OdometryStateTopic>();
    let state = &states[0].head;
    assert_eq!(state.retired_stamp_ns, 1_700_000_006_649_979_660);
    assert_eq!(
        state.retired_pose,
        [
            0.411_234_182_318_150_57,
            0.823_578_640_741_101_5,
            2.306_781_871_350_502
        ]
    );
    assert_eq!(
        (state.trust, state.imu_use),
        (Trust::Good as u32, ImuUse::Covered as u32)
    );
    let counts = [
        recorded::<RadarPoints>().len(),
        recorded::<ImuSampleTopic>().len(),
        recorded::<Keyframe>().len(),
        recorded::<MapperGrid>().len(),
        recorded::<StageHealthTopic>().len(),
    ];
    assert_eq!(counts, [2, 100, 1, 7, 6]);
}

/// Where this fails a layout has changed: `fixtures/README.md` says what to do.
#[test]
fn the_newest_kept_log_has_the_layouts_of_this_build() {
    let mut reader = LogReader::open(&fixture(newest())).unwrap();
    while reader.next_entry().unwrap().is_some() {}
    let kept: BTreeMap<&str, _> = reader
        .channels()
        .map(|channel| (channel.topic.as_str(), channel))
        .collect();
    let own = channels();
    assert_eq!(kept.len(), own.len());
    for own in &own {
        let kept = kept[own.topic.as_str()];
        let [kept, described] =
            [&kept.schema, &own.schema].map(|text| String::from_utf8_lossy(text));
        assert_eq!(
            kept, described,
            "{} has another layout than the newest kept log",
            own.topic
        );
    }
}

/// Writes the newest kept log: once, when a layout has changed.
#[test]
#[ignore = "writes a file of the repository"]
fn write_the_newest_kept_log() {
    let bytes = write(Cursor::new(Vec::new())).into_inner();
    let path = fixture(newest());
    let mut file = fs::File::create_new(path).unwrap();
    file.write_all(&bytes).unwrap();
}
