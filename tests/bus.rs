//! Programs of other languages on the bus, by what `randt layout` prints for them.

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::up::up;
use crate::support::{ended, ended_within, python, randt, tum};
use randt_stage::{Entry, Registry};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Scans that the example follows.
const SCANS: usize = 15;
/// Longest that it may take: it waits for scans that come at 5 Hz.
const TIME_MAX: Duration = Duration::from_secs(60);

fn printed(language: &str) -> String {
    let ended = ended(randt(&["layout", language]));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    ended.stdout
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/bus")
}

#[test]
fn the_header_and_the_module_have_the_sizes_and_offsets_that_they_state() {
    let folder = tempfile::tempdir().unwrap();
    for (language, file, compiler, options) in [
        (
            "--c",
            "randt_bus.h",
            "cc",
            ["-std=c11", "-Werror", "-fsyntax-only", "-xc"],
        ),
        (
            "--rust",
            "randt_bus.rs",
            "rustc",
            ["--edition=2021", "--crate-type=lib", "-o", "lib.rlib"],
        ),
    ] {
        let path = folder.path().join(file);
        fs::write(&path, printed(language)).unwrap();
        let mut compile = Command::new(compiler);
        compile.args(options).arg(&path).current_dir(folder.path());
        let compiled = ended(compile);
        assert_eq!(compiled.code, Some(0), "{language}: {}", compiled.stderr);
    }
    // The sizes are held against the compiler's: a wrong one is refused.
    let wrong =
        printed("--c").replace("(struct randt_header) == 32", "(struct randt_header) == 40");
    let path = folder.path().join("wrong.h");
    fs::write(&path, wrong).unwrap();
    let mut compile = Command::new("cc");
    compile
        .args(["-std=c11", "-fsyntax-only", "-xc"])
        .arg(&path);
    assert_ne!(ended(compile).code, Some(0));
}

#[test]
fn a_python_program_prints_the_pose_that_the_drive_has() {
    let Some(mut follow) = python::program(&examples().join("follow_pose.py")) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    fs::write(folder.path().join("randt_bus.py"), printed("--python")).unwrap();
    follow.env("PYTHONPATH", folder.path());
    let pipeline = Pipeline::new("bus");
    let out = folder.path().join("up");
    let mut up = up(pipeline.domain(), &log, &out);
    up.stdout(Stdio::null()).stderr(Stdio::null());
    let mut up = up.spawn().unwrap();
    let computes = |(entry, lives): &(Entry, bool)| {
        *lives && ["odometry", "mapper"].contains(&entry.name.as_str()) && entry.topics.len() > 1
    };
    let all = || Registry::all(pipeline.domain());
    until("stages", || {
        all().iter().filter(|stage| computes(stage)).count() == 2
    });
    pipeline.enter(&mut follow);
    follow.args(["--scans", &SCANS.to_string()]);
    let ended = ended_within(follow, TIME_MAX);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(up.wait().unwrap().success());
    let expected = tum(&out.join("odometry.tum"));
    let mut lines = ended.stdout.lines();
    assert_eq!(lines.next(), Some("stamp_ns,frame,x_m,y_m,yaw_rad,trust"));
    let mut count = 0;
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |field: usize| fields[field].parse::<f64>().unwrap();
        let stamp_ns: i64 = fields[0].parse().unwrap();
        let row = expected.iter().find(|row| row.stamp_ns == stamp_ns);
        let pose = row
            .map(|row| row.pose)
            .unwrap_or_else(|| panic!("{line}: no such scan"));
        // No loop has been closed yet: the first frame is the map's.
        let expected = [pose.x_m, pose.y_m, pose.yaw_rad];
        let off = (2..)
            .zip(expected)
            .map(|(field, expected)| (number(field) - expected).abs());
        assert!(off.fold(0.0, f64::max) < 1e-3, "{line}: {pose:?}");
        assert!(["good", "degraded", "lost"].contains(&fields[5]), "{line}");
        count += 1;
    }
    assert_eq!(count, SCANS);
}
