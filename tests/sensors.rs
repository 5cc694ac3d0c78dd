//! Sensors that are absent, unplugged, plugged in again elsewhere, or something else: `randt top`
//! shows it, and they are tried again for ever. What `randt doctor sensors` makes of them.

use crate::support::pipeline::{Pipeline, log};
use crate::support::sensors::{Emulator, Sensors};
use crate::support::stages::program;
use crate::support::{ended, randt};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// A driver is back within two seconds; `randt top` needs two to look.
const SEEN_MAX: Duration = Duration::from_secs(60);

/// A driver and how `randt top` shows it.
struct Watched<'a> {
    pipeline: &'a Pipeline,
    stage: &'a str,
}

impl Watched<'_> {
    fn row(&self) -> Value {
        let ended = self.pipeline.randt(&["top", "--once", "--json"]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
        let rows = figures["stages"].as_array().unwrap();
        rows.iter()
            .find(|row| row["name"] == self.stage)
            .unwrap()
            .clone()
    }

    /// Waits until it is in a state and its status has all these words.
    fn becomes(&self, state: &str, words: &[&str]) {
        let begin = Instant::now();
        loop {
            let row = self.row();
            let message = row["message"].as_str().unwrap();
            if row["state"] == state && words.iter().all(|word| message.contains(word)) {
                println!("{}: {state}: {message}", self.stage);
                // The same process all along.
                assert_eq!(row["restarts"], 0);
                return;
            }
            assert!(
                begin.elapsed() < SEEN_MAX,
                "{state} {words:?}: waited for in vain: {row}"
            );
        }
    }
}

fn start(pipeline: &mut Pipeline, stage: &str, robot: &Path, more: &[&str]) {
    let mut command = Command::new(program(stage));
    pipeline.enter(&mut command);
    command.arg("--robot").arg(robot).args(more);
    pipeline.start(stage, command);
}

#[test]
fn an_imu_may_be_absent_gone_back_elsewhere_or_something_else() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 100);
    let sensors = Sensors::new(folder.path(), "beam-udp", "mip");
    let device = sensors.device();
    let name = device.display().to_string();
    let mut pipeline = Pipeline::new("imu");
    start(&mut pipeline, "imu", &sensors.robot(), &[]);
    let imu = Watched {
        pipeline: &pipeline,
        stage: "imu",
    };
    imu.becomes("degraded", &[&name, "not there"]);

    let plugged = sensors.imu(&log, &["--loop"]);
    imu.becomes("running", &[]);
    drop(plugged);
    imu.becomes("degraded", &[&name]);

    // Another pseudo-terminal, as a device gets another number.
    let plugged = sensors.imu(&log, &["--loop"]);
    imu.becomes("running", &[]);
    drop(plugged);

    let _ = fs::remove_file(&device);
    fs::write(&device, "not a device").unwrap();
    imu.becomes("degraded", &[&name, "file"]);
    fs::remove_file(&device).unwrap();
    fs::create_dir(&device).unwrap();
    imu.becomes("degraded", &[&name, "directory"]);
    fs::remove_dir(&device).unwrap();
    std::os::unix::fs::symlink("/dev/null", &device).unwrap();
    imu.becomes("degraded", &[&name, "serial"]);
    fs::remove_file(&device).unwrap();

    let _plugged = sensors.imu(&log, &["--loop"]);
    imu.becomes("running", &[]);
}

#[test]
fn an_imu_and_wheels_come_by_lines_of_text() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("wheels.mcap");
    let mut made = randt(&[
        "simulate",
        "building",
        "--scans",
        "60",
        "--wheels",
        "scale=1.02",
    ]);
    made.arg("--out").arg(&log);
    assert_eq!(ended(made).code, Some(0));
    let sensors = Sensors::new(folder.path(), "beam-udp", "line");
    let mut pipeline = Pipeline::new("lines");
    start(&mut pipeline, "imu", &sensors.robot(), &[]);
    let imu = Watched {
        pipeline: &pipeline,
        stage: "imu",
    };
    let _plugged = sensors.imu(&log, &["--loop"]);
    imu.becomes("running", &[]);
    // Both topics, at their rates.
    let begin = Instant::now();
    loop {
        let ended = pipeline.randt(&["top", "--once", "--json"]);
        let figures: Value = serde_json::from_str(&ended.stdout).unwrap();
        let topics = figures["topics"].as_array().unwrap();
        let rate_hz = |name: &str| {
            let topic = topics.iter().find(|topic| topic["name"] == name);
            topic
                .and_then(|topic| topic["rate_hz"].as_f64())
                .unwrap_or_default()
        };
        let (samples, twists) = (rate_hz("imu/sample/v1"), rate_hz("robot/twist/v1"));
        if (200.0..300.0).contains(&samples) && (40.0..60.0).contains(&twists) {
            return;
        }
        assert!(begin.elapsed() < SEEN_MAX, "{}", ended.stdout);
    }
}

#[test]
fn a_radar_may_be_absent_gone_or_something_else() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 100);
    let sensors = Sensors::new(folder.path(), "navtech", "mip");
    let mut pipeline = Pipeline::new("radar");
    start(
        &mut pipeline,
        "radar",
        &sensors.robot(),
        &["--sensor", "isdr-c"],
    );
    let radar = Watched {
        pipeline: &pipeline,
        stage: "radar",
    };
    radar.becomes("degraded", &[&sensors.address(), "refused"]);

    let there = sensors.radar(&log, &["--loop"]);
    radar.becomes("running", &[]);
    drop(there);
    radar.becomes("degraded", &[&sensors.address()]);

    // Something else answers there.
    let other = TcpListener::bind(sensors.address()).unwrap();
    let (ends, ended) = std::sync::mpsc::channel::<()>();
    let web = std::thread::spawn(move || {
        other.set_nonblocking(true).unwrap();
        let mut clients = Vec::new();
        while ended.try_recv() != Err(std::sync::mpsc::TryRecvError::Disconnected) {
            if let Ok((mut client, _)) = other.accept() {
                let _ = client.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n");
                clients.push(client);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    radar.becomes("degraded", &[&sensors.address(), "configuration"]);
    drop(ends);
    web.join().unwrap();

    let _there = sensors.radar(&log, &["--loop"]);
    radar.becomes("running", &[]);
}

/// What `randt doctor sensors` prints, and its exit code.
fn doctor(pipeline: &Pipeline, robot: &Path, more: &[&str]) -> (Option<i32>, String) {
    let mut command = pipeline.command(&["doctor", "sensors"]);
    command.arg("--robot").arg(robot).args(more);
    let ended = ended(command);
    println!("{}", ended.stdout);
    (ended.code, ended.stdout)
}

#[test]
fn the_doctor_checks_whether_sensors_answer_and_make_sense() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 300);
    let sensors = Sensors::new(folder.path(), "beam-udp", "xsens");
    let robot = sensors.robot();
    let mut pipeline = Pipeline::new("doctor");
    let (code, output) = doctor(&pipeline, &robot, &["--seconds", "2"]);
    assert_eq!(code, Some(1));
    // A socket that is open is no radar that was there.
    assert!(!output.contains("interruptions"), "{output}");
    for words in ["BAD   radar", "BAD   imu", "not there", &sensors.address()] {
        assert!(output.contains(words), "{words}");
    }

    let second = format!("{:.3}", crate::support::sensors::unix_s());
    let begin = ["--loop", "--at", &second];
    let plugged: [Emulator; 2] = [sensors.radar(&log, &begin), sensors.imu(&log, &begin)];
    // The drive begins with a stand, and then it turns.
    std::thread::sleep(Duration::from_secs(8));
    let wanted = [
        "ok    radar      beams come from",
        "sweeps a second",
        "no beam of",
        "ok    imu        samples come from",
        "ok    gravity    up is +z",
        "ok    rotation",
    ];
    let (code, output) = doctor(&pipeline, &robot, &["--seconds", "15"]);
    assert_eq!(code, Some(0));
    for words in wanted {
        assert!(output.contains(words), "{words}");
    }

    // Through the drivers, which keep running.
    start(&mut pipeline, "radar", &robot, &[]);
    start(&mut pipeline, "imu", &robot, &[]);
    let (code, output) = doctor(&pipeline, &robot, &["--seconds", "5"]);
    assert_eq!(code, Some(0));
    for words in [
        "ok    radar      randt-radar runs",
        "ok    imu        randt-imu runs",
        "ok    gravity",
    ] {
        assert!(output.contains(words), "{words}");
    }
    drop(plugged);
}

#[test]
fn a_robot_that_no_driver_takes_is_a_wrong_configuration_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.toml");
    let out = folder.path().join("out");
    for (radar, imu, key) in [
        (
            "address = \"radar.local:6320\"",
            "device = \"/dev/ttyACM0\"",
            "radar.address",
        ),
        (
            "address = \"239.1.1.1:6320\"\ninterface = \"eth0\"",
            "device = \"/dev/ttyACM0\"",
            "radar.interface",
        ),
        (
            "address = \"[ff02::1]:6320\"",
            "device = \"/dev/ttyACM0\"",
            "radar.address",
        ),
        ("address = \"0.0.0.0:6320\"", "device = \"\"", "imu.device"),
    ] {
        let text =
            format!("[radar]\nsource = \"beam-udp\"\n{radar}\n[imu]\nsource = \"mip\"\n{imu}\n");
        fs::write(&robot, text).unwrap();
        let pipeline = Pipeline::new("wrong");
        let mut command = pipeline.command(&["up"]);
        command.arg("--robot").arg(&robot).arg("--out").arg(&out);
        let ended = ended(command);
        assert_eq!(ended.code, Some(78), "{}", ended.stderr);
        assert!(ended.stderr.contains(key), "{key}: {}", ended.stderr);
        assert!(!out.exists());
    }
}
