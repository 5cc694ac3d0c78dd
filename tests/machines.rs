//! Machines with and without fused multiply-add and vector units agree: the program once as it is,
//! once on an emulated processor of 2008 (`qemu-user`).

use crate::support::stages::program;
use crate::support::{ended, recording, tum};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Names of the emulator: as Debian has it, and linked statically.
const EMULATORS: [&str; 2] = ["qemu-x86_64", "qemu-x86_64-static"];
/// SSE 4.2, but neither AVX nor FMA.
const OLD: [&str; 2] = ["-cpu", "Nehalem"];
/// How far poses may differ, m and rad.
const POSE_MAX: f64 = 1e-6;
/// Laps of 13 m: loops need 15 m of path.
const SCANS: &str = "250";
const ROOM: &str = "\
wall concrete 0,0 9,0 9,7 0,7 0,0
block metal 0.4,3 0.6x1.8
block wood 4,3 1.2x1
post concrete 7.5,5.8 0.25
wall plaster 3,0 3,1
route 1.8,1.8 7.2,1.8 7.2,5.2 1.8,5.2
";

/// The emulator, or `None` where there is none; CI must have it.
fn emulator() -> Option<&'static str> {
    let answers = |name: &&str| {
        let mut version = Command::new(name);
        version.arg("-version").stdout(Stdio::null());
        version.status().is_ok_and(|status| status.success())
    };
    let found = EMULATORS.into_iter().find(answers);
    if found.is_none() {
        let ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
        assert!(!ci, "no {}: install qemu-user", EMULATORS[0]);
        println!("skipped: no {}", EMULATORS[0]);
    }
    found
}

/// `randt` on this machine, or on an old one.
fn randt(emulator: Option<&str>) -> Command {
    on(emulator, Path::new(env!("CARGO_BIN_EXE_randt")))
}

/// A program there.
fn on(emulator: Option<&str>, program: &Path) -> Command {
    let Some(emulator) = emulator else {
        return Command::new(program);
    };
    let mut command = Command::new(emulator);
    command.args(OLD).arg(program);
    command
}

/// Runs a command that must succeed, and gives what it printed.
fn printed(command: Command) -> String {
    let ended = ended(command);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    ended.stdout
}

#[test]
fn a_drive_with_loops_ends_in_the_same_map() {
    let Some(old) = emulator() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("room.world"), ROOM).unwrap();
    let mut simulate = randt(None);
    simulate.args(["simulate", "--scans", SCANS, "--world"]);
    simulate
        .arg(at("room.world"))
        .arg("--out")
        .arg(at("a.mcap"));
    printed(simulate);
    for (name, machine) in [("here", None), ("old", Some(old))] {
        let mut run = randt(machine);
        run.arg("run").arg(at("a.mcap")).arg("--out").arg(at(name));
        printed(run);
    }
    let report = |name: &str| crate::support::report(&at(name))["loops"]["statuses"].take();
    let statuses = report("here");
    println!("loops: {statuses}");
    // Most loops of a small room confirm its map.
    let count = |status: &str| statuses[status].as_u64().unwrap_or(0);
    assert!(count("accepted") >= 1, "{statuses}");
    assert!(count("accepted") + count("confirmed") >= 5, "{statuses}");
    assert_eq!(report("old"), statuses);
    let text = |name: &str| fs::read_to_string(at(name)).unwrap();
    assert_eq!(text("old/odometry.tum"), text("here/odometry.tum"));
    for name in ["trajectory.tum", "keyframes.tum"] {
        let difference = difference(&at("here").join(name), &at("old").join(name));
        println!("{name}: {difference:e}");
        assert!(difference <= POSE_MAX, "{name}: {difference}");
    }
}

/// Largest difference between two files of the same rows, m and rad.
fn difference(a: &Path, b: &Path) -> f64 {
    let (a, b) = (tum(a), tum(b));
    assert_eq!(a.len(), b.len());
    let rows = a.iter().zip(&b).map(|(a, b)| {
        assert_eq!((a.stamp_ns, a.frame), (b.stamp_ns, b.frame));
        let off = a.pose.between(&b.pose);
        off.translation().norm().max(off.yaw_rad.abs())
    });
    rows.fold(0.0, f64::max)
}

#[test]
fn pose_graphs_have_the_same_optimum_and_the_same_false_loops() {
    let Some(old) = emulator() else { return };
    for (name, false_loops) in [("CSAIL", "30"), ("intel", "10")] {
        let Some(file) = recording(&format!("posegraph/{name}.g2o")) else {
            return;
        };
        let figures = |machine: Option<&str>| -> Value {
            let mut graph = on(machine, &program("lab"));
            graph.args(["graph", "--json", "--false-loops", false_loops]);
            graph.arg(&file);
            let mut figures: Value = serde_json::from_str(&printed(graph)).unwrap();
            // Times are the machine's.
            figures["time_ms"].take();
            figures["recheck_ms"].take();
            figures
        };
        let here = figures(None);
        println!("{name}: {here}");
        assert_eq!(figures(Some(old)), here);
    }
}

/// Programs of an ARM board, emulated. They are made so, in ten minutes of CPU:
///
/// ```text
/// rustup target add aarch64-unknown-linux-gnu
/// apt-get install gcc-aarch64-linux-gnu qemu-user
/// CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
/// CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc \
/// cargo build --target aarch64-unknown-linux-gnu
/// RANDT_TEST_ARM=target/aarch64-unknown-linux-gnu/debug/randt \
/// cargo test --workspace --test programs machines:: -- --ignored
/// ```
#[test]
#[ignore = "needs programs for aarch64 in RANDT_TEST_ARM; a minute"]
fn an_arm_board_has_the_same_bits() {
    let program = std::env::var("RANDT_TEST_ARM").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut inputs = vec![at("a.mcap")];
    let mut simulate = randt(None);
    simulate.args(["simulate", "building", "--scans", "300", "--out"]);
    printed({
        simulate.arg(&inputs[0]);
        simulate
    });
    inputs.extend(recording("bags/room_loops.bag"));
    inputs.extend(recording("radar/oxford"));
    for input in inputs {
        let mut here = randt(None);
        let mut board = Command::new("qemu-aarch64");
        board.args(["-L", "/usr/aarch64-linux-gnu", &program]);
        for (name, command) in [("here", &mut here), ("board", &mut board)] {
            let _ = fs::remove_dir_all(at(name));
            command.arg("run").arg(&input).arg("--out").arg(at(name));
        }
        printed(here);
        printed(board);
        for file in [
            "odometry.csv",
            "odometry.tum",
            "trajectory.tum",
            "keyframes.tum",
            "map.pgm",
        ] {
            let [here, board] =
                ["here", "board"].map(|name| fs::read(at(name).join(file)).unwrap());
            assert!(here == board, "{}: {file} differs", input.display());
        }
        println!("{}: the same bits", input.display());
    }
}
