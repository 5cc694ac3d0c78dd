//! What whole-program tests share: the binary with a time limit, the recordings, trajectories,
//! hostile inputs.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

pub mod bag;
pub mod boot;
pub mod browser;
pub mod calls;
pub mod cgroup;
pub mod corrupt_inputs;
pub mod directives;
pub mod drive;
pub mod fault_injection;
pub mod journal;
pub mod killer;
pub mod l_shaped_world;
pub mod large;
pub mod observer;
pub mod package;
pub mod pages;
pub mod phidgets;
pub mod pipeline;
pub mod programs;
pub mod python;
pub mod radio;
pub mod recorded;
pub mod recordings;
pub mod robot;
pub mod ros2_nodes;
pub mod sensors;
pub mod stages;
pub mod turns;
pub mod up;
pub mod viewer;
pub mod watch;

pub use recordings::recording;

use randt_geometry::Pose2;
use randt_geometry::elementary::atan2;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use turns::Computing;

/// No run may take longer, whatever it is given: seconds where nothing else runs.
const TIME_MAX: Duration = Duration::from_secs(120);

/// How a run of the program ended.
#[derive(Debug)]
pub struct Ended {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ended {
    /// Whether standard error contains these words.
    pub fn stderr_contains(&self, words: &str) -> bool {
        self.stderr.contains(words)
    }
}

/// The program, ready for more arguments, its working folder or its environment.
pub fn randt(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_randt"));
    command.args(arguments);
    command
}

/// The research bench, likewise.
pub fn lab(arguments: &[&str]) -> Command {
    let mut command = Command::new(stages::program("lab"));
    command.args(arguments);
    command
}

/// Removes a folder in which others still make files, as `rm -r` until nothing is left.
pub fn remove_folder(folder: &Path) {
    while let Err(error) = fs::remove_dir_all(folder) {
        match error.kind() {
            ErrorKind::DirectoryNotEmpty => {}
            ErrorKind::NotFound => break,
            _ => panic!("{}: {error}", folder.display()),
        }
    }
}

/// Runs a command; fails where it takes more than two minutes.
pub fn ended(command: Command) -> Ended {
    ended_within(command, TIME_MAX)
}

/// The same with a limit of its own, for drives of many minutes.
///
/// It goes behind what runs in real time in other tests: an emulated sensor that is kept from
/// sending loses data, as a real one does.
pub fn ended_within(command: Command, time_max: Duration) -> Ended {
    let _turn = computes(&command).then(Computing::begin);
    let folder = tempfile::tempdir().unwrap();
    let [out, err] = ["stdout", "stderr"].map(|name| folder.path().join(name));
    let mut child = behind(&command)
        .stdin(Stdio::null())
        .stdout(File::create(&out).unwrap())
        .stderr(File::create(&err).unwrap())
        .spawn()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > time_max {
            child.kill().unwrap();
            panic!("{command:?}: not ended after {time_max:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let text = |path: &Path| String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    Ended {
        code: status.code(),
        stdout: text(&out),
        stderr: text(&err),
    }
}

/// Whether a command takes a whole core for seconds.
fn computes(command: &Command) -> bool {
    const COMMANDS: [&str; 8] = [
        "ablation",
        "bench",
        "calibrate",
        "demo",
        "graph",
        "register",
        "run",
        "simulate",
    ];
    let first = command.get_args().next();
    first.is_some_and(|first| COMMANDS.iter().any(|name| first == *name))
}

/// The command at a lower priority.
fn behind(command: &Command) -> Command {
    let mut nice = Command::new("nice");
    nice.args(["-n", "10"]).arg(command.get_program());
    nice.args(command.get_args());
    for (key, value) in command.get_envs() {
        match value {
            Some(value) => nice.env(key, value),
            None => nice.env_remove(key),
        };
    }
    if let Some(folder) = command.get_current_dir() {
        nice.current_dir(folder);
    }
    nice
}

/// `randt run INPUT --out OUT` with more arguments.
pub fn run(input: &Path, out: &Path, more: &[&str]) -> Ended {
    let mut command = randt(&["run"]);
    command.arg(input).arg("--out").arg(out).args(more);
    ended(command)
}

/// Names below a folder, sorted; empty where it is absent.
pub fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// What a run writes.
pub const OUTPUTS: [&str; 9] = [
    "keyframes.tum",
    "map.pgm",
    "map.png",
    "map.yaml",
    "odometry.csv",
    "odometry.tum",
    "plot.svg",
    "report.json",
    "trajectory.tum",
];

/// The report without what may differ between runs.
pub fn report(out: &Path) -> serde_json::Value {
    let mut report: serde_json::Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    assert!(
        report.as_object_mut().unwrap().remove("timing").is_some(),
        "timing stands in one object"
    );
    report
}

/// The figures of `randt-lab eval` for a trajectory of a run, its loops included.
pub fn figures(out: &Path, trajectory: &str, truth: &Path) -> serde_json::Value {
    let mut command = lab(&["eval", "--json"]);
    command.arg(out.join(trajectory)).arg(truth);
    command.arg("--loops").arg(out.join("report.json"));
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// One row of a TUM file.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub stamp_ns: i64,
    /// Number of the comment `# odom_frame_id` before it.
    pub frame: u64,
    pub pose: Pose2,
}

/// The rows of a TUM file.
pub fn tum(path: &Path) -> Vec<Row> {
    let mut frame = 0;
    let mut rows = Vec::new();
    for line in fs::read_to_string(path).unwrap().lines() {
        if let Some(number) = line.strip_prefix("# odom_frame_id ") {
            frame = number.parse().unwrap();
            continue;
        }
        let cells: Vec<&str> = line.split(' ').collect();
        let (seconds, fraction) = cells[0].split_once('.').unwrap();
        assert_eq!((cells.len(), fraction.len()), (8, 9), "{line}");
        let value = |i: usize| cells[i].parse::<f64>().unwrap();
        assert!((1..8).all(|i| value(i).is_finite()), "{line}");
        rows.push(Row {
            stamp_ns: seconds.parse::<i64>().unwrap() * 1_000_000_000
                + fraction.parse::<i64>().unwrap(),
            frame,
            pose: Pose2::new(value(1), value(2), 2.0 * atan2(value(6), value(7))),
        });
    }
    rows
}

/// The pose at an instant between two of the rows; they must be of one frame.
pub fn pose_at(rows: &[Row], stamp_ns: i64) -> Pose2 {
    let after = rows.partition_point(|row| row.stamp_ns < stamp_ns);
    let (a, b) = (&rows[after.saturating_sub(1)], &rows[after]);
    assert!(
        a.stamp_ns <= stamp_ns,
        "{stamp_ns} is before the first row at {}",
        a.stamp_ns
    );
    assert_eq!(a.frame, b.frame);
    let span = (b.stamp_ns - a.stamp_ns).max(1);
    a.pose
        .interpolate(&b.pose, (stamp_ns - a.stamp_ns) as f64 / span as f64)
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
}
