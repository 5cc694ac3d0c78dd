//! Programs of other languages on the bus, by what `randt layout` prints for them.

mod long_reader;
mod mavlink;

use crate::support::pipeline::{Pipeline, log, until};
use crate::support::stages::beside;
use crate::support::up::up;
use crate::support::{Row, ended, ended_within, python, randt, tum};
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

/// The example in C, compiled and linked as its own words say.
fn follow_in_c(folder: &Path) -> Command {
    fs::write(folder.join("randt_bus.h"), printed("--c")).unwrap();
    let library = beside("deps/librandt_bus.so");
    let libraries = library.parent().unwrap();
    let program = folder.join("follow_pose");
    let mut compile = Command::new("cc");
    compile.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"]);
    compile.arg(folder).arg(examples().join("follow_pose.c"));
    compile
        .arg("-L")
        .arg(libraries)
        .args(["-lrandt_bus", "-lm"]);
    let compiled = ended({
        compile.arg("-o").arg(&program);
        compile
    });
    assert_eq!(compiled.code, Some(0), "{}", compiled.stderr);
    let mut follow = Command::new(program);
    follow.env("LD_LIBRARY_PATH", libraries);
    follow
}

#[test]
fn programs_in_c_rust_and_python_print_the_pose_that_the_drive_has() {
    let folder = tempfile::tempdir().unwrap();
    let log = log(folder.path(), 40);
    let pipeline = Pipeline::new("bus");
    let scans = SCANS.to_string();
    let mut in_c = follow_in_c(folder.path());
    in_c.arg(&scans).arg(pipeline.domain().prefix());
    in_c.arg(pipeline.domain().run());
    let mut in_rust = Command::new(beside("follow_pose"));
    pipeline.enter(&mut in_rust);
    in_rust.args(["--scans", &scans]);
    let mut programs = vec![("C", in_c), ("Rust", in_rust)];
    if let Some(mut in_python) = python::program(&examples().join("follow_pose.py")) {
        fs::write(folder.path().join("randt_bus.py"), printed("--python")).unwrap();
        in_python.env("PYTHONPATH", folder.path());
        pipeline.enter(&mut in_python);
        in_python.args(["--scans", &scans]);
        programs.push(("Python", in_python));
    }
    let out = folder.path().join("up");
    let mut up = up(pipeline.domain(), &log, &out);
    let said = folder.path().join("up.txt");
    up.stdout(Stdio::null())
        .stderr(fs::File::create(&said).unwrap());
    let mut up = up.spawn().unwrap();
    let computes = |(entry, lives): &(Entry, bool)| {
        *lives && ["odometry", "mapper"].contains(&entry.name.as_str()) && entry.topics.len() > 1
    };
    let all = || Registry::all(pipeline.domain());
    until("stages", || {
        all().iter().filter(|stage| computes(stage)).count() == 2
    });
    let programs = programs.into_iter().map(|(language, program)| {
        let follow = std::thread::spawn(move || ended_within(program, TIME_MAX));
        (language, follow)
    });
    let programs: Vec<_> = programs.collect();
    let printed = programs.into_iter().map(|(language, follow)| {
        let ended = follow.join().unwrap();
        assert_eq!(ended.code, Some(0), "{language}: {}", ended.stderr);
        (language, ended.stdout)
    });
    let printed: Vec<_> = printed.collect();
    let ended = up.wait().unwrap();
    let said = fs::read_to_string(said).unwrap();
    assert!(ended.success(), "{ended}: {said}");
    let expected = tum(&out.join("odometry.tum"));
    for (language, printed) in printed {
        check(language, &printed, &expected);
    }
}

/// Holds what an example has printed against the drive's poses.
fn check(language: &str, printed: &str, expected: &[Row]) {
    let mut lines = printed.lines();
    let heading = lines.next();
    assert_eq!(
        heading,
        Some("stamp_ns,frame,x_m,y_m,yaw_rad,trust"),
        "{language}"
    );
    let mut count = 0;
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |field: usize| fields[field].parse::<f64>().unwrap();
        let stamp_ns: i64 = fields[0].parse().unwrap();
        let row = expected.iter().find(|row| row.stamp_ns == stamp_ns);
        let pose = row
            .map(|row| row.pose)
            .unwrap_or_else(|| panic!("{language}: {line}: no such scan"));
        // No loop has been closed yet: the first frame is the map's.
        let expected = [pose.x_m, pose.y_m, pose.yaw_rad];
        let off = (2..)
            .zip(expected)
            .map(|(field, expected)| (number(field) - expected).abs());
        let off = off.fold(0.0, f64::max);
        assert!(off < 1e-3, "{language}: {line}: {pose:?}");
        let trust = fields[5];
        assert!(["good", "degraded", "lost"].contains(&trust), "{line}");
        count += 1;
    }
    assert_eq!(count, SCANS, "{language}");
}
