//! `randt inspect` as a user calls it, and a drive in several logs.

use crate::support::corrupt_inputs::checked;
use crate::support::{drive, ended, randt, recorded, report, tum};
use randt::pipeline::Pipeline;
use randt_config::Config;
use randt_mapper::journal;
use randt_messages::{Keyframe, MessageRef, OdometryState};
use randt_odometry::Sink;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const SCANS: u64 = 30;

fn inspect(folder: &Path, input: &str) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_randt"))
        .args(["inspect", "--json", input])
        .current_dir(folder)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn an_inspection_names_what_is_there_what_is_odd_and_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let mut events = drive::events(SCANS);
    drive::write(&events, &folder.path().join("drive.mcap"));
    let found = inspect(folder.path(), "drive.mcap");
    assert_eq!(
        (&found["sweeps"], &found["steps_back"]),
        (&SCANS.into(), &0.into())
    );
    assert!(found["sweeps_with_imu"].as_u64().unwrap() + 2 >= SCANS);
    assert!(
        (found["imu_hz"].as_f64().unwrap() - 250.0).abs() < 1.0,
        "{}",
        found["imu_hz"]
    );
    let command = found["command"].as_str().unwrap();
    assert!(
        command.starts_with("randt run drive.mcap --out RESULTS"),
        "{command}"
    );
    let picture = found["picture"].as_str().unwrap();
    let svg = fs::read_to_string(folder.path().join(picture)).unwrap();
    assert_eq!(svg.matches("scan after").count(), 3);
    assert_eq!(found["doubts"], Value::Array(vec![]));

    // Every second beam of a radar that is no iSDR-C: the command has what it differs by.
    let mut coarse = drive::events(SCANS);
    for event in &mut coarse {
        if let randt_readers::Event::Scan(scan) = event {
            scan.head.sweep.azimuth_step_rad *= 0.5;
        }
    }
    drive::write(&coarse, &folder.path().join("coarse.mcap"));
    let command = inspect(folder.path(), "coarse.mcap")["command"].to_string();
    assert!(
        command.contains(" --set sensor.azimuth_step_rad=0.01428"),
        "{command}"
    );

    // Four sweeps are missing, and the IMU hangs upside down.
    let mut number = 0;
    events.retain_mut(|event| {
        if let randt_readers::Event::Imu(sample) = event {
            sample.acceleration_m_s2[2] *= -1.0;
        }
        let is_scan = matches!(event, randt_readers::Event::Scan(_));
        number += usize::from(is_scan);
        !(is_scan && (10..14).contains(&number))
    });
    drive::write(&events, &folder.path().join("odd.mcap"));
    let doubts = inspect(folder.path(), "odd.mcap")["doubts"].to_string();
    assert!(
        doubts.contains("1 gap between sweeps") && doubts.contains("robot.imu_roll_rad"),
        "{doubts}"
    );
}

#[test]
fn a_mission_of_several_logs_is_computed_as_one_drive() {
    let folder = tempfile::tempdir().unwrap();
    let events = drive::events(SCANS);
    let whole = folder.path().join("whole.mcap");
    drive::write(&events, &whole);
    let mission = folder.path().join("mission");
    fs::create_dir_all(mission.join("logs")).unwrap();
    for (number, part) in events.chunks(events.len().div_ceil(3)).enumerate() {
        drive::write(part, &mission.join(format!("logs/{number}.mcap")));
    }
    let (one, several) = (checked(&whole, &[]), checked(&mission, &[]));
    one.finished(0, SCANS as usize);
    several.finished(0, SCANS as usize);
    let read = |out: &Path| fs::read(out.join("odometry.tum")).unwrap();
    assert!(read(&one.out) == read(&several.out));
    // A log of it that cannot be read, or of which damage leaves nothing, is no shorter drive in
    // silence.
    let mut damaged = fs::read(mission.join("logs/1.mcap")).unwrap();
    let chunk = damaged.len() / 2;
    damaged[chunk] ^= 8;
    for bytes in [damaged, Vec::new()] {
        fs::write(mission.join("logs/1.mcap"), bytes).unwrap();
        let without = checked(&mission, &[]);
        assert_eq!((without.code(), without.counter("logs_unreadable")), (3, 1));
    }
    let mut plot = randt(&["plot"]);
    plot.arg(&mission)
        .arg("--out")
        .arg(folder.path().join("plots"));
    let plot = ended(plot);
    assert_eq!(plot.code, Some(3), "{}", plot.stderr);
    assert!(plot.stderr_contains("1.mcap"), "{}", plot.stderr);
}

/// Writes the journal that a mapper would.
struct Journal(Vec<u8>);

impl Sink for Journal {
    fn state(&mut self, _: &OdometryState) {}
    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        journal::append_keyframe(keyframe, &mut self.0).unwrap();
    }
}

#[test]
fn a_journal_gives_the_map_of_its_drive() {
    let folder = tempfile::tempdir().unwrap();
    let events = drive::events(3 * SCANS);
    let log = folder.path().join("drive.mcap");
    drive::write(&events, &log);
    let mounting = randt_simulator::Robot::default().radar_mounting;
    let mut config = Config::default();
    (config.robot.radar_x_m, config.robot.radar_y_m) = (mounting.x_m, mounting.y_m);
    let mut written = Journal(Vec::new());
    journal::begin(&config, &mut written.0);
    let mut pipeline = Pipeline::new(&config, true);
    events
        .iter()
        .for_each(|event| pipeline.push(event, &mut written));
    pipeline.finish(&mut written);
    let path = folder.path().join("map.journal");
    fs::write(&path, &written.0).unwrap();

    let keyframes = pipeline.mapper().keyframes().len();
    assert!(keyframes >= 5, "{keyframes}");
    let (whole, of_journal) = (checked(&log, &[]), checked(&path, &[]));
    let read = |out: &Path| fs::read(out.join("keyframes.tum")).unwrap();
    assert!(read(&whole.out) == read(&of_journal.out));
    of_journal.finished(0, keyframes);
    assert_eq!(
        of_journal.counter("poses_of_keyframes_only"),
        keyframes as u64
    );
    assert_eq!(of_journal.counter("journal_of_another_configuration"), 0);
    let other = checked(&path, &["--set", "loops.fit_min=0.9"]);
    assert_eq!(other.counter("journal_of_another_configuration"), 1);
    let found = inspect(folder.path(), "map.journal");
    assert_eq!(found["keyframes"], keyframes);

    // What is damaged is not there, and said.
    written.0[200..]
        .iter_mut()
        .step_by(5000)
        .for_each(|b| *b ^= 1);
    fs::write(&path, &written.0).unwrap();
    let damaged = checked(&path, &[]);
    assert!([1, 3].contains(&damaged.code()), "{}", damaged.ended.stdout);
}

/// A mission in seven files: one command computes it, compares it with what was published, and maps
/// it.
fn seven_files(scans: u64) {
    let folder = tempfile::tempdir().unwrap();
    let mission = folder.path().join("mission");
    let begin = Instant::now();
    recorded::write_mission(scans, 7, &mission);
    println!("{scans} scans written in {:.0?}", begin.elapsed());
    let begin = Instant::now();
    // Without the bound that other runs have.
    let out = folder.path().join("out");
    let mut run = Command::new(env!("CARGO_BIN_EXE_randt"));
    let run = run
        .arg("run")
        .arg(&mission)
        .arg("--compare")
        .arg("--out")
        .arg(&out);
    let ran = run.output().unwrap();
    let stdout = String::from_utf8_lossy(&ran.stdout);
    println!("computed in {:.0?}\n{stdout}", begin.elapsed());
    assert_eq!(
        ran.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    let (report, rows) = (report(&out), tum(&out.join("trajectory.tum")));
    assert_eq!(
        (&report["scans"], rows.len()),
        (&scans.into(), scans as usize)
    );
    assert_eq!(report["frames"].as_array().unwrap().len(), 1);
    assert!(stdout.contains("the same to the last bit"), "{stdout}");
}

#[test]
fn a_mission_in_seven_files_is_computed_compared_and_mapped() {
    seven_files(70);
}

/// `cargo test --workspace --test programs -- --ignored three_hours --nocapture`
#[test]
#[ignore = "twenty minutes and 10 GB of disk"]
fn three_hours_in_seven_files_are_computed_compared_and_mapped() {
    seven_files(54_000);
}
