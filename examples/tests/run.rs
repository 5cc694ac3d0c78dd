//! The examples as programs, on simulated drives.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

use randt_log::{LogFile, Options, ROBOT_METADATA};
use randt_messages::{ImuSampleTopic, Message, MessageRef, OdometryState, OdometryStateTopic};
use randt_simulator::{Event, Robot, Simulation, World};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

const OFFLINE_RUN: &str = env!("CARGO_BIN_EXE_offline_run");
const REGISTER: &str = env!("CARGO_BIN_EXE_register_two_scans");
const LOOP_GATE: &str = env!("CARGO_BIN_EXE_custom_loop_gate");
const RADAR: &str = env!("CARGO_BIN_EXE_custom_radar");
const STAGE: &str = env!("CARGO_BIN_EXE_custom_stage");

/// A drive through the building as a log.
fn drive(folder: &Path, scans: u64) -> PathBuf {
    let path = folder.join("drive.mcap");
    let robot = Robot::default();
    let mut log = LogFile::create(&path, Options::default()).unwrap();
    let metadata = randt_log::Robot {
        sensor: robot.sensor(),
        radar: Some(robot.radar_mounting.to_array()),
        imu: Some([1.0, 0.0, 0.0, 0.0]),
    };
    log.write_metadata(ROBOT_METADATA, metadata.to_metadata())
        .unwrap();
    for event in Simulation::new(&World::building(), robot, scans, 7) {
        match &event {
            Event::Scan(scan) => log.write(scan.as_ref()).unwrap(),
            Event::Imu(head) => {
                let sample = MessageRef::<ImuSampleTopic> { head, items: &[] };
                log.write(sample).unwrap();
            }
            Event::Twist(_) | Event::Truth(_) => {}
        }
    }
    log.finish().unwrap();
    path
}

/// What a program prints.
fn printed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// The number behind the first of these words.
fn number(text: &str, word: &str) -> f64 {
    let mut words = text.split_ascii_whitespace();
    words.find(|found| *found == word).unwrap();
    words.next().unwrap().parse().unwrap()
}

#[test]
fn a_recording_becomes_a_trajectory_a_motion_and_loops() {
    let folder = tempfile::tempdir().unwrap();
    let log = drive(folder.path(), 60);
    let trajectory = printed(Command::new(OFFLINE_RUN).arg(&log));
    let last: Vec<f64> = trajectory
        .lines()
        .last()
        .unwrap()
        .split(' ')
        .map(|field| field.parse().unwrap())
        .collect();
    assert!(
        trajectory.lines().count() > 8 && last.len() == 8,
        "{trajectory}"
    );

    // The robot drives straight on at up to 1 m/s: 0.2 m a scan.
    let motion = printed(Command::new(REGISTER).arg(&log).arg("40"));
    assert!((0.15..0.25).contains(&number(&motion, "x")), "{motion}");
    assert!(number(&motion, "y").abs() < 0.03, "{motion}");

    let loops = printed(Command::new(LOOP_GATE).arg(&log));
    assert!(loops.contains("converged true"), "{loops}");
}

#[test]
fn lines_of_an_own_radar_become_sweeps() {
    let mut radar = Command::new(RADAR);
    radar.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut radar = radar.stderr(Stdio::piped()).spawn().unwrap();
    let mut input = radar.stdin.take().unwrap();
    writeln!(input, "this is no beam").unwrap();
    for sweep in 0..4_u64 {
        for beam in 0..100 {
            let device_ns = (sweep * 100 + beam) * 2_000_000;
            let azimuth_deg = beam as f64 * 3.6;
            writeln!(
                input,
                "{sweep} {beam} 100 {azimuth_deg} {device_ns} 5.0 60 9.0 70"
            )
            .unwrap();
        }
    }
    drop(input);
    let output = radar.wait_with_output().unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    let sweeps = printed
        .lines()
        .filter(|line| line.starts_with("sweep of 100 beams, 200 returns"));
    assert!(sweeps.count() >= 2, "{printed}");
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "lines_bad 1\n");
}

#[test]
fn a_stage_of_ones_own_goes_on_after_a_kill() {
    let run = tempfile::Builder::new().tempdir_in("/dev/shm").unwrap();
    let prefix = format!("example-{}", std::process::id());
    let domain = randt_stage::Domain::new(&prefix, Some(run.path())).unwrap();
    let mut odometry = randt_stage::Stage::open("odometry", &domain).unwrap();
    let mut states = odometry.publisher::<OdometryStateTopic>().unwrap();
    odometry.running().unwrap();
    let mut message = Message::<OdometryStateTopic>::default();
    let mut publish = |id: u64| {
        *message.head = OdometryState {
            id,
            pose: [0.5 * id as f64, 0.0, 0.0],
            ..OdometryState::default()
        };
        states.publish(message.as_ref()).unwrap();
    };
    (0..10).for_each(&mut publish);
    let mut driven = |until: &str| {
        let mut stage = Command::new(STAGE);
        stage.args(["--prefix", &prefix, "--run"]).arg(run.path());
        let mut stage = stage.stdout(Stdio::piped()).spawn().unwrap();
        // The history is delivered while this process waits.
        let mut lines = BufReader::new(stage.stdout.take().unwrap()).lines();
        let (give, take) = std::sync::mpsc::channel();
        std::thread::spawn(move || lines.by_ref().try_for_each(|line| give.send(line)));
        let found = (0..600).any(|_| {
            odometry.wait(&[], Some(Duration::from_millis(50))).unwrap();
            take.try_iter().any(|line| line.unwrap() == until)
        });
        stage.kill().unwrap();
        stage.wait().unwrap();
        found
    };
    assert!(
        driven("4.50 m"),
        "ten states are nine steps of half a metre"
    );
    (10..12).for_each(&mut publish);
    assert!(
        driven("5.50 m"),
        "the states before the kill are in it once"
    );
}
