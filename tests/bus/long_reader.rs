//! A reader in Python, for long, and readers that are killed beside it.

use super::printed;
use crate::support::pipeline::{Pipeline, log, until};
use crate::support::{ended, python, up::up};
use randt_stage::Registry;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// Sweeps of the drive: ten minutes.
const SWEEPS: u32 = 3_000;
/// Readers that are killed: more than a topic has places for.
const KILLED: usize = 8;
/// A reader lives that long before it is killed.
const LIFE: Duration = Duration::from_secs(5);

/// Starts a reader; what it prints goes into a file.
fn start(pipeline: &Pipeline, folder: &Path, out: &Path) -> Option<Child> {
    let mut read = python::script("follow_imu.py")?;
    pipeline.enter(&mut read);
    read.env("PYTHONPATH", folder);
    read.stdout(File::create(out).unwrap());
    Some(read.spawn().unwrap())
}

/// Samples that it has, and those that it missed.
fn read(out: &Path) -> (u64, u64) {
    let printed = fs::read_to_string(out).unwrap();
    let last = printed.lines().last().unwrap_or("0 0");
    let (count, missed) = last.split_once(' ').unwrap();
    (count.parse().unwrap(), missed.parse().unwrap())
}

#[test]
#[ignore = "ten minutes: cargo test --workspace --test programs long_reader:: -- --ignored --nocapture"]
fn a_reader_in_python_keeps_up_and_those_that_are_killed_let_go() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), SWEEPS);
    fs::write(folder.path().join("randt_bus.py"), printed("--python")).unwrap();
    let pipeline = Pipeline::new("long");
    let out = folder.path().join("up");
    let mut up: Command = up(pipeline.domain(), &log, &out);
    up.stdout(Stdio::null())
        .stderr(File::create(folder.path().join("up.txt")).unwrap());
    let mut up = up.spawn().unwrap();
    let plays = |name: &str| {
        let all = Registry::all(pipeline.domain());
        all.iter()
            .any(|(entry, lives)| *lives && entry.name == name && entry.topics.len() > 2)
    };
    until("play", || plays("play") && plays("odometry"));
    let samples = folder.path().join("samples.txt");
    let mut reader = start(&pipeline, folder.path(), &samples).expect("Python");
    for number in 0..KILLED {
        let own = folder.path().join(format!("killed-{number}.txt"));
        let mut killed = start(&pipeline, folder.path(), &own).unwrap();
        sleep(LIFE);
        killed.kill().unwrap();
        killed.wait().unwrap();
        assert!(read(&own).0 > 250, "reader {number} has no place");
        let cleaned = ended(pipeline.command(&["doctor", "--clean"]));
        println!("{}", cleaned.stdout);
    }
    let ended = up.wait().unwrap();
    println!(
        "{}",
        fs::read_to_string(folder.path().join("up.txt")).unwrap()
    );
    assert!(ended.success(), "nothing is lost");
    reader.kill().unwrap();
    reader.wait().unwrap();
    let (count, missed) = read(&samples);
    println!("{count} samples read, {missed} missed");
    assert_eq!(missed, 0);
    assert!(count > u64::from(SWEEPS) * 50 - 3_000, "{count}");
}
