//! Logs of earlier layouts, kept in `fixtures`: each is read for as long as there are robots that
//! recorded such logs.

mod messages;

use messages::{
    correction, graph, health, keyframe, missing, points, sample, scan, state, tile, truth, twist,
};
use randt_log::{LogReader, LogWriter, Options, ROBOT_METADATA, Robot, channels};
use randt_messages::{
    ImuSampleTopic, ImuUse, Keyframe, LogDropTopic, MapperCorrection, MapperGraph, MapperGrid,
    Message, OdometryStateTopic, RadarPoints, RadarScan, SensorKind, StageHealthTopic, Topic,
    Trust, TruthPoseTopic, TwistTopic,
};
use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Seek, Write};
use std::path::{Path, PathBuf};

/// Logs with one message of every topic. The last one has the layouts of this build.
const KEPT: [&str; 4] = [
    "layouts-2.mcap",
    "layouts-3.mcap",
    "layouts-4.mcap",
    "layouts-5.mcap",
];

/// Those of them from before there were twists, and before loops that confirm were counted.
const TWISTLESS: [&str; 2] = ["layouts-2.mcap", "layouts-3.mcap"];

fn newest() -> &'static str {
    KEPT.last().unwrap()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
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
    writer.write(twist().as_ref()).unwrap();
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

/// A state and a keyframe as logs have them that do not know how scans were judged.
fn not_judged(
    mut state: Message<OdometryStateTopic>,
    mut keyframe: Message<Keyframe>,
) -> (Message<OdometryStateTopic>, Message<Keyframe>) {
    let head = &mut *state.head;
    (head.weak_direction_rad, head.fit) = (0.0, 0.0);
    (head.trust_reasons, head.localizability) = (0, 0);
    let head = &mut *keyframe.head;
    (head.weak_direction_rad, head.trust) = (0.0, 0);
    (head.trust_reasons, head.localizability) = (0, 0);
    (state, keyframe)
}

#[test]
fn every_field_of_a_kept_log_is_read() {
    for name in KEPT {
        let (mut state, mut keyframe) = (state(), keyframe());
        if name == "layouts-2.mcap" {
            (state, keyframe) = not_judged(state, keyframe);
        }
        let mut graph = graph();
        if TWISTLESS.contains(&name) {
            // Confirmed loops were not counted apart.
            graph.head.confirmed_loops = 0;
        }
        let log = fixture(name);
        assert_eq!(LogReader::open(&log).unwrap().robot().unwrap(), robot());
        assert!(read::<RadarScan>(&log) == scan(), "{name}");
        assert!(read::<RadarPoints>(&log) == points(), "{name}");
        assert_eq!(read::<ImuSampleTopic>(&log), sample(), "{name}");
        if !TWISTLESS.contains(&name) {
            assert_eq!(read::<TwistTopic>(&log), twist(), "{name}");
        }
        assert_eq!(read::<OdometryStateTopic>(&log), state, "{name}");
        assert!(read::<Keyframe>(&log) == keyframe, "{name}");
        assert_eq!(read::<MapperCorrection>(&log), correction(), "{name}");
        assert_eq!(read::<MapperGraph>(&log), graph, "{name}");
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
        // They were not judged then.
        let text = text
            .replace(
                "it has no weak_direction_rad, fit, trust_reasons, localizability",
                "",
            )
            .replace("it has no weak_direction_rad, trust, localizability", "")
            .replace("it has no confirmed_loops", "");
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
