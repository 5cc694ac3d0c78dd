//! What the last build before this one has left: its logs and maps are read, its running state is
//! set apart with words.
//!
//! The files are of commit 30a8848; `tests/fixtures/README.md` says how they were made.

use crate::support::journal::keyframes;
use crate::support::pipeline::{Pipeline, until};
use crate::support::stages::program;
use crate::support::{OUTPUTS, ended, names, randt, report, run};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn fixture(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/layouts-1");
    folder.join(name)
}

/// Two seconds' worth of every topic of a drive, two scans among them.
fn log() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../core/log/tests/fixtures");
    folder.join("layouts-1.mcap")
}

/// Starts a stage in a pipeline whose state it finds; gives what it writes to standard error.
fn start(pipeline: &mut Pipeline, name: &str, folder: &Path, more: &[&str]) -> PathBuf {
    let errors = folder.join("errors");
    let mut command = Command::new("sh");
    let script = format!("exec \"$0\" \"$@\" 2>{}", errors.display());
    command.args(["-c", &script]).arg(program(name));
    pipeline.enter(&mut command);
    command.args(more);
    pipeline.start(name, command);
    errors
}

#[test]
fn a_log_of_before_is_run_and_what_it_lacks_is_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let ended = run(&log(), &out, &[]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(names(&out), OUTPUTS);
    let report = report(&out);
    assert_eq!(report["scans"], 2);
    let translated = &report["counters"]["topics_of_another_build"];
    let first = translated["first"].as_str().unwrap();
    // Nothing of what is computed with lacks.
    assert!(first.contains("radar/scan/v1"), "{first}");
    assert!(!first.contains("it has no"), "{first}");
    assert!(!first.contains("does not know"), "{first}");
}

#[test]
fn a_log_of_before_is_plotted_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let [pictures, tables] = ["pictures", "tables"].map(|name| folder.path().join(name));
    let mut plot = randt(&["plot"]);
    plot.arg(log()).arg("--out").arg(&pictures);
    let plot = ended(plot);
    assert_eq!(plot.code, Some(0), "{}", plot.stderr);
    assert!(names(&pictures).contains(&"path.svg".to_owned()));
    let mut export = randt(&["log", "export"]);
    export
        .arg(log())
        .args(["--to", "csv", "--out"])
        .arg(&tables);
    let export = ended(export);
    assert_eq!(export.code, Some(0), "{}", export.stderr);
    let topics = [
        "imu_sample_v1.csv",
        "mapper_correction_v1.csv",
        "mapper_graph_v1.csv",
        "mapper_grid_v1.csv",
        "odometry_keyframe_v1.csv",
        "odometry_state_v1.csv",
        "radar_points_v1.csv",
        "radar_scan_v1.csv",
        "stage_health_v1.csv",
    ];
    assert_eq!(names(&tables), topics);
    // Columns are the log's own.
    let corrections = fs::read_to_string(tables.join("mapper_correction_v1.csv")).unwrap();
    assert!(
        corrections.contains(",odom_frame_id,part,pose.0,"),
        "{corrections}"
    );
}

#[test]
fn a_map_of_before_is_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("map.journal");
    fs::copy(fixture("map.journal"), &journal).unwrap();
    let expected: Vec<_> = (0..8).map(|id| (id, 0)).collect();
    assert_eq!(keyframes(&journal), expected);
    let mut pipeline = Pipeline::new("map");
    let path = journal.display().to_string();
    let errors = start(
        &mut pipeline,
        "mapper",
        folder.path(),
        &["--journal", &path],
    );
    let said = || fs::read_to_string(&errors).unwrap();
    until("the map", || said().contains("has all of its 8 keyframes"));
    let form = "snapshots have another form; its keyframes are taken anew";
    assert!(said().contains(form), "{}", said());
    pipeline.kill_all();
    assert_eq!(keyframes(&journal), expected);
    let files = ["errors", "map.journal", "map.journal.lock"];
    assert_eq!(names(folder.path()), files, "nothing is quarantined");
}

#[test]
fn odometrys_state_of_before_is_set_apart_with_words_and_its_pose_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::new("state");
    let state = pipeline.domain().state();
    fs::create_dir_all(&state).unwrap();
    fs::copy(fixture("odometry.pose"), state.join("odometry.pose")).unwrap();
    // The second of the two versions that the file has room for, the first one to be written.
    let version = fs::read(fixture("odometry.state")).unwrap();
    let room = 64 + (4 << 20);
    let mut bytes = vec![0; 2 * room];
    bytes[room..room + version.len()].copy_from_slice(&version);
    fs::write(state.join("odometry.state"), bytes).unwrap();
    let errors = start(&mut pipeline, "odometry", folder.path(), &[]);
    let said = || fs::read_to_string(&errors).unwrap();
    until("a new frame", || {
        said().contains("begins frame 1 at the last pose")
    });
    let said = said();
    assert!(said.contains("odometry.state.quarantined"), "{said}");
    pipeline.kill_all();
    let kept = fs::read(state.join("odometry.state.quarantined")).unwrap();
    assert_eq!(kept, version[64..]);
}

#[test]
fn every_program_names_its_version_and_commit() {
    let programs = [
        "filter", "imu", "mapper", "odometry", "radar", "recorder", "view",
    ];
    let stages = programs.map(|name| (format!("randt-{name}"), program(name)));
    let randt = (
        "randt".to_owned(),
        PathBuf::from(env!("CARGO_BIN_EXE_randt")),
    );
    for (name, path) in stages.into_iter().chain([randt]) {
        let mut command = Command::new(path);
        command.arg("--version");
        let expected = format!("{name} {}\n", randt_version::VERSION);
        assert_eq!(ended(command).stdout, expected);
    }
}
